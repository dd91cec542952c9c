"""What the command `sdimu` calls: loads the rest, and runs it."""

from __future__ import annotations

from sdimu_calibration.loading import ending_at_once


def sdimu() -> None:
    """Run `sdimu`; Ctrl-C ends it without a traceback while it loads, too."""
    with ending_at_once():
        from sdimu_calibration.cli.main import main
    main()
