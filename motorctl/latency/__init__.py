"""Wake-up latency and turnaround of this machine, measured with the real loop process."""

from motorctl.latency.measure import LatencyOptions, measure_latency

__all__ = ["LatencyOptions", "measure_latency"]
