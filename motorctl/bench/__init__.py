"""How fast it is: speed figures beside peers, and this machine's latency beside cyclictest."""
