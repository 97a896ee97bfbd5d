# What runs inside the machine, as root in /job, after each of its two starts.
# Nothing but what the wheels bring is to be found by a program here.
rm -rf motorctl
exec python3 -B story.py
