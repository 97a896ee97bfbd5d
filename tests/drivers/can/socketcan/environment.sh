export PYTHONPATH=/job/motorctl:/job/motorctl/drivers:/job/motorctl/devices:/opt/packages
export XDG_CACHE_HOME=/job/kept OMP_NUM_THREADS=1
# code that every processor runs, so that what was compiled outside the machine serves inside
export NUMBA_CPU_NAME=generic
