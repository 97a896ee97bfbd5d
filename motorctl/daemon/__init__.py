"""The supervisor: control socket, recorder, metrics, life and death of the loop process.

`motorctl.daemon.supervisor.run_daemon` is the daemon; `motorctl.daemon.client.Client` talks to one.
Both are imported from their modules, so that a command of the client starts without the
daemon's libraries.
"""
