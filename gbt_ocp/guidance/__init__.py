"""What the vehicle wants of its bearings, and how it moves for it."""

from gbt_ocp.guidance.apart import Apart, KeepApart
from gbt_ocp.guidance.circumnavigation import Circumnavigation
from gbt_ocp.guidance.current import Current, CurrentObserver, KnownCurrent
from gbt_ocp.guidance.fim_placement import FimPlacement
from gbt_ocp.guidance.helical import HelicalGuidance
from gbt_ocp.guidance.information import FisherInformation, NearInformation
from gbt_ocp.guidance.objectives import BearingSimilarity, RangePull, sigma_points
from gbt_ocp.guidance.open_loop import ConstantForce, RandomThrust, Static
from gbt_ocp.guidance.others import OtherVehicles, SaidPath
from gbt_ocp.guidance.pacing import PacedBearing, steady_speed
from gbt_ocp.guidance.past import PastBearings
from gbt_ocp.guidance.path_information import MotionInformation, PosteriorVariance
from gbt_ocp.guidance.planned import PlannedMotion
from gbt_ocp.guidance.standoff import RangeOfHypotheses, ReachableRange
from gbt_ocp.guidance.startup import CrossFirst
from gbt_ocp.guidance.strategy import BearingGuidance, Guidance, Placement
from gbt_ocp.guidance.swept import SweptBearing
from gbt_ocp.guidance.target_limits import FieldOfView, RangeLimits
from gbt_ocp.guidance.water import InWater, OverGround

__all__ = [
    "Apart",
    "BearingGuidance",
    "BearingSimilarity",
    "Circumnavigation",
    "ConstantForce",
    "CrossFirst",
    "Current",
    "CurrentObserver",
    "FieldOfView",
    "FimPlacement",
    "FisherInformation",
    "Guidance",
    "HelicalGuidance",
    "InWater",
    "KeepApart",
    "KnownCurrent",
    "MotionInformation",
    "NearInformation",
    "OtherVehicles",
    "OverGround",
    "PacedBearing",
    "PastBearings",
    "Placement",
    "PlannedMotion",
    "PosteriorVariance",
    "RandomThrust",
    "RangeLimits",
    "RangeOfHypotheses",
    "RangePull",
    "ReachableRange",
    "SaidPath",
    "Static",
    "SweptBearing",
    "sigma_points",
    "steady_speed",
]
