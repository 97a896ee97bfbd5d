# What runs inside the machine, as root in /job: two stories, each on a bus of its own.
. ./environment.sh
modprobe -a can-raw vcan
for bus in vcan0 vcan1; do
    ip link add dev $bus type vcan
    ip link set $bus mtu 72 up
done
now() { cut -d' ' -f1 /proc/uptime; }
compiled() { find kept -name '*.nb[ic]' | wc -l; }
echo "begins at $(now) s, $(compiled) kernels compiled"
# without real-time priorities: an emulated processor is slow, and what must answer would starve
setpriv --bounding-set=-sys_nice python3 -B loop_story.py result &
python3 -B driver_story.py result || touch result/driver.done
echo "the driver's story ended at $(now) s"
wait
echo "ended at $(now) s, $(compiled) kernels compiled"
