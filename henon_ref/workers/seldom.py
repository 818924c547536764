"""What a server of workers imports first: it begins to look for garbage seldom, before the rest is imported."""

from henon_ref.workers.worker import collect_seldom

collect_seldom()
