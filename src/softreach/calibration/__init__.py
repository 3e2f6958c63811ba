"""Calibration: the arm on the bench from measured poses, and which poses to measure."""

from softreach.calibration.calibration import calibrate, leave_one_run_out
from softreach.calibration.errors import PlacementErrors, Repeatability, Verdict
from softreach.calibration.fit import Uncertainty
from softreach.calibration.measurements import Measurements, read_measurements
from softreach.calibration.plan import PosePlan, plan_poses
from softreach.calibration.result import Calibration, Rival
from softreach.support.report import Report

__all__ = ["Calibration", "Measurements", "PlacementErrors", "PosePlan", "Repeatability", "Report"]
__all__ += ["Rival", "Uncertainty", "Verdict", "calibrate", "leave_one_run_out", "plan_poses"]
__all__ += ["read_measurements"]
