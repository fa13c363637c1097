"""Estimation: where the tracked agent is, from range measurements alone (thesis chapter 2), and never wrongly.

Sets, not densities: as long as every measurement's error stays within its stated bound, the target is inside every set
here. :class:`RangeFilter` is the thesis' filter in a form that keeps this promise in floating point,
:class:`TightSet` the nearly exact set beside it; the control laws say where a robot should go to learn more.
"""

from estimation.bearing_embedding import BearingEmbedding
from estimation.bernstein_embedding import BernsteinEmbedding
from estimation.calibration import Calibration, calibrate
from estimation.containment_monitor import ContainmentMonitor
from estimation.ellipsoid import Ellipsoid, EmptyIntersection
from estimation.feasible_set import FeasibleSet
from estimation.fusion import fuse
from estimation.information_control import covariance_direction, information_gradient
from estimation.information_filter import InformationFilter
from estimation.look_ahead import look_ahead
from estimation.range_embedding import RangeEmbedding
from estimation.range_filter import RangeFilter
from estimation.shared_ranges import SharedRanges
from estimation.strip import Strip
from estimation.strip_cut import cut
from estimation.thesis_filter import ThesisRangeFilter
from estimation.tight_set import TightSet

__all__ = [
    "BearingEmbedding",
    "BernsteinEmbedding",
    "Calibration",
    "ContainmentMonitor",
    "Ellipsoid",
    "EmptyIntersection",
    "FeasibleSet",
    "InformationFilter",
    "RangeEmbedding",
    "RangeFilter",
    "SharedRanges",
    "Strip",
    "ThesisRangeFilter",
    "TightSet",
    "calibrate",
    "covariance_direction",
    "cut",
    "fuse",
    "information_gradient",
    "look_ahead",
]
