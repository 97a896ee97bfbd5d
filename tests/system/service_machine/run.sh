# What runs inside the machine, as root in /job, after each of its two starts.
# Nothing but what the wheels bring is to be found by a program here.
rm -rf motorctl
# what was compiled outside serves every command here
export NUMBA_CPU_NAME=generic OMP_NUM_THREADS=1 CACHE_DIRECTORY=/var/cache/device
exec python3 -B story.py
