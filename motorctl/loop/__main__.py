"""``python -m motorctl.loop``: the loop process, started by the supervisor."""

import sys

from motorctl.loop.process import main

sys.exit(main())
