"""The Python interface: what the verbs of `sdimu` do, as functions and objects for scripts and notebooks.

    import sdimu_calibration as sdimu
    test = sdimu.open("bag", site="daejeon", imu="dtg")
    fit = sdimu.calibrate(test)
    found = sdimu.diagnose(fit)
    better = fit.add(found.best)
    sdimu.compare(fit, better)

Arrays are SI in the reported body frame; whatever a person reads is in customary units (deg/h, ppm, arcmin, ug).
"""
