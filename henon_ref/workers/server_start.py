"""What a server of workers imports first: it looks for garbage seldom, and ends at once when its caller has ended.

Taking apart all that it has imported would take up to a second, for which it holds the caller's standard output.
"""

import atexit
import os

from henon_ref.workers.worker import collect_seldom

collect_seldom()
atexit.register(os._exit, 0)
