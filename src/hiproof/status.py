"""What became of a building: an outcome is a value, and its text is the sentence the user reads."""

from enum import Enum


class Status(Enum):
    """Outcome of one building. `is_model` tells whether a solid exists."""

    MODELLED = "modelled"
    SIMPLIFIED = (
        "simplified: the fitted roof could not become a valid solid, a simpler one stands in for it"
    )
    FLAT_FALLBACK = (
        "flat block: too few points to determine a roof shape, its height is the median of the "
        "points"
    )
    NO_POINTS = "no model: no usable points inside the footprint; add a cloud that covers it"
    NO_BUILDING = "no model: nothing stands on the footprint, its points lie on the ground"
    BAD_FOOTPRINT = "no model: the footprint has no usable area; repair or remove it"
    NOT_BUILT = "no model: the parameters given make no valid solid; mend them"
    LEFT_OUT = "no model: left out, as its override says"
    NO_ROOF = "no model: the points form no roof (all in one place or on one line)"
    INTERNAL_ERROR = "no model: hiproof failed on this building; please report it with its points"

    @property
    def is_model(self) -> bool:
        return not self.value.startswith("no model")

    @property
    def code(self) -> str:
        """Stable lower-case name for files and tables."""
        return self.name.lower()


class Grade(Enum):
    """How good a model is, told from its points (evaluate/verdict.py)."""

    GOOD = "the roof follows its points"
    FAIR = "some of its points speak against the roof"
    POOR = "look at the building before you use it"

    @property
    def code(self) -> str:
        """Stable lower-case name for files and tables."""
        return self.name.lower()


class Doubt(Enum):
    """What the detail of a building may leave to doubt, by the words that stand in it; a run counts
    them at its end.
    """

    TWO_SURFACES = "points lie on two surfaces"
    PLACES_WITHOUT_POINTS = "of its outline hold no points"
    POINTS_ABOVE = "above the model"
    POINTS_BELOW = "below the model"
    UNSUPPORTED = "stand on hardly any point"
    GROUND_ABOVE_EAVES = "m above its eaves"
    TERRAIN_UNLIKE_GROUND_POINTS = "the ground points around it"
    TERRAIN_WITHOUT_HEIGHTS = "holds values that are no heights"
    GROUND_GIVEN_ELSEWHERE = "the ground given lies"
    ASSUMED_GROUND = "its ground is assumed"
    POINTS_OF_OTHER_CLASSES = "points of other classes lie high above the ground"
    BARE_GROUND = "its ground lies bare"
    BARE_GROUND_INSIDE = "of bare ground inside its footprint"
    GROUND_UNDER_ROOF = "ground points lie under the roof"

    @property
    def told(self) -> str:
        return self.name.lower().replace("_", " ")
