#!/bin/bash
# Run the job on the second disk, write its result on the third, go off. A job that starts the
# machine anew is run again where it left /job.
export PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8
mkdir -p /job/result
[ -e /job/run.sh ] || tar xf /dev/vdb -C /job
cd /job || busybox poweroff -f
limit_s=$(sed -n 's/.*job_limit_s=\([0-9]*\).*/\1/p' /proc/cmdline)
# Whoever started the machine may be gone by then: it ends by itself.
(sleep $((limit_s + 30)); echo "machine: out of time"; busybox poweroff -f) &
echo "machine: the job begins at $(cut -d' ' -f1 /proc/uptime) s"
timeout -k 10 "$limit_s" bash run.sh >> result/stdout 2>> result/stderr < /dev/null
echo $? > result/exit_status
echo "machine: the job ended at $(cut -d' ' -f1 /proc/uptime) s"
tar cf /dev/vdc result
sync
busybox poweroff -f
