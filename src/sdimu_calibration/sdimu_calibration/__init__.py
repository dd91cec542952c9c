"""Navigation-level calibration of a strapdown inertial measurement unit on a rate table."""

import os

# The matrices here are small (tens to hundreds of rows): a second thread costs more than it brings, and on a busy
# machine it waits for its core a hundred times longer than the work takes. Only holds if numpy is not loaded yet.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
