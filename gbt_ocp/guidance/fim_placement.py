"""FIM placement: the vehicle is put where the next bearing informs best, without any dynamics."""

from __future__ import annotations

from gbt_ocp.guidance.strategy import Placement
from gbt_ocp.models.bearings import DesiredBearing
from gbt_ocp.models.sizes import positive
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.typing import Array


class FimPlacement:
    """``o_{k+1} = p̂_{k+1|k} - r_d g_{k+1}`` with bearings g that run around the circle or cone of ``op_bearings``.

    Bearings with ``Σ g gᵀ = (n/d) I`` over n steps maximise the determinant of the Fisher information at equal range
    (Bishop, Fidan, Anderson, Doğançay and Pathirana, "Optimality analysis of sensor-target localization geometries",
    Automatica 46 (2010)); the desired bearings do so over their m steps, in space on a cone of elevation 35.26°. As in
    the paper the vehicle has no dynamics: it jumps.

    Parameters
    ----------
    desired
        g(t).
    period
        T in seconds.
    standoff
        r_d in metres.

    Raises
    ------
    ValueError
        If a number is not above 0.
    """

    def __init__(self, desired: DesiredBearing, period: float, *, standoff: float) -> None:
        self._desired = desired
        self._period = positive("period", period)
        self._standoff = positive("standoff", standoff)

    def decide(self, time: float, flat: Array, forecast: Forecast) -> Placement:
        """Where the vehicle is at the next step."""
        return Placement(forecast.mean[1] - self._standoff * self._desired(time + self._period))
