"""For other programs: a running machine to Prometheus, samples to PlotJuggler."""
