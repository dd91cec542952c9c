"""What the command `sdimu` calls: loads the rest, and runs it."""

from __future__ import annotations

import gc

from sdimu_calibration.loading import ending_at_once

_SELDOM = (250_000, 20, 50)
"""Number of new objects between searches for garbage, and of searches among older ones: what loads and makes a
diagnosis are 220,000, of which a thousand are garbage, and Python's own (700, 10, 10) spend 5 to 10 % on it."""


def sdimu() -> None:
    """Run `sdimu`; Ctrl-C ends it without a traceback while it loads, too."""
    gc.set_threshold(*_SELDOM)
    with ending_at_once():
        from sdimu_calibration.cli.main import main
    try:
        main()
    finally:
        # A process that ends looks through all of its objects for garbage, thrice: a quarter of a second.
        gc.freeze()
