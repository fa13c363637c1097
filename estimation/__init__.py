"""Estimation: where the tracked agent is, from range measurements alone (thesis chapter 2), and never wrongly.

Sets, not densities: as long as every measurement's error stays within its stated bound, the target is inside every set
here. :class:`RangeFilter` is the thesis' filter in a form that keeps this promise in floating point,
:class:`TightSet` the nearly exact set beside it; the control laws say where a robot should go to learn more.
"""

from estimation.bearing_embedding import BearingEmbedding
from estimation.bernstein_embedding import BernsteinEmbedding
from estimation.calibration import Calibration, NotCalibrated, calibrate
from estimation.containment_monitor import ContainmentMonitor, Verdict
from estimation.ellipsoid import Ellipsoid, EmptyIntersection, NotAnEllipsoid
from estimation.feasible_set import EmptyFeasibleSet, FeasibleSet, Region
from estimation.fusion import choose_weight, fuse
from estimation.information_control import Limits, NotAnEstimate, covariance_direction, information_gradient
from estimation.information_filter import InformationFilter
from estimation.look_ahead import look_ahead
from estimation.outlier_rule import Relaxation
from estimation.range_embedding import NotAMeasurement, RangeEmbedding, range_bounds
from estimation.range_filter import FilterReport, FilterSnapshot, RangeFilter
from estimation.range_log import BadRecord, TimedRange
from estimation.range_measurement import BadRange, NothingMeasured
from estimation.shared_ranges import Digest, SharedRanges
from estimation.shared_snapshot import TimedSnapshot, fuse_snapshots, predict_snapshot
from estimation.spread import spread_points
from estimation.strip import Strip
from estimation.strip_cut import cut
from estimation.thesis_filter import ThesisRangeFilter
from estimation.tight_set import TightReport, TightSet

__all__ = [
    "BadRange",
    "BadRecord",
    "BearingEmbedding",
    "BernsteinEmbedding",
    "Calibration",
    "ContainmentMonitor",
    "Digest",
    "Ellipsoid",
    "EmptyFeasibleSet",
    "EmptyIntersection",
    "FeasibleSet",
    "FilterReport",
    "FilterSnapshot",
    "InformationFilter",
    "Limits",
    "NotAMeasurement",
    "NotAnEllipsoid",
    "NotAnEstimate",
    "NotCalibrated",
    "NothingMeasured",
    "RangeEmbedding",
    "RangeFilter",
    "Region",
    "Relaxation",
    "SharedRanges",
    "Strip",
    "ThesisRangeFilter",
    "TightReport",
    "TightSet",
    "TimedRange",
    "TimedSnapshot",
    "Verdict",
    "calibrate",
    "choose_weight",
    "covariance_direction",
    "cut",
    "fuse",
    "fuse_snapshots",
    "information_gradient",
    "look_ahead",
    "predict_snapshot",
    "range_bounds",
    "spread_points",
]
