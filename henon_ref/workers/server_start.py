"""First import of a fork server: collects garbage rarely, and exits at once when its caller has ended.

A normal exit would take up to a second to free all imports, during which it keeps the caller's standard output open.
"""

import atexit
import os

from henon_ref.workers.worker import collect_seldom

collect_seldom()
atexit.register(os._exit, 0)
