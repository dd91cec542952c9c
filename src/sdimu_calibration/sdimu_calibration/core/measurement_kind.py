"""What an epoch measures. @compiled loops take these constants, so this file is part of the key of their cache."""

from __future__ import annotations

SKIP, SENSORS, ALL, HELD_SENSORS, HELD_ALL = 0, 1, 2, -1, -2
"""Nothing; Zw and Zf; Zp, Zv, Zw and Zf. Held out: predicted and scored, not taken."""
