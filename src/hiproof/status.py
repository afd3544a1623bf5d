"""The outcomes of a building: values with the sentence that users read."""

from enum import Enum


class Coded(Enum):
    """Values with a sentence each."""

    @property
    def code(self) -> str:
        """Stable lower-case name for files, tables and options."""
        return self.name.lower()


class Status(Coded):
    """Outcome of one building. `is_model` tells whether a solid exists."""

    MODELLED = "modelled"
    SIMPLIFIED = (
        "simplified: the fitted roof could not become a valid solid, a simpler one stands in for it"
    )
    FLAT_FALLBACK = (
        "flat block: too few points to determine a roof shape, its height is the median of the "
        "points"
    )
    FROM_ATTRIBUTES = (
        "flat block: no usable points, its height is that of the footprint's attributes"
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


class Grade(Coded):
    """How good a model is, told from its points (evaluate/verdict.py)."""

    GOOD = "the roof looks right over its points"
    FAIR = "a part of the roof does not fit its points"
    POOR = "look at the building before you use it"


class Doubt(Coded):
    """The doubts that a building's detail may name, by the words that a run counts."""

    TWO_SURFACES = "points lie on two surfaces"
    PLACES_WITHOUT_POINTS = "of its outline hold no points"
    POINTS_ABOVE = "above the model"
    POINTS_BELOW = "below the model"
    UNSUPPORTED = "stand on hardly any point"
    OTHER_SLOPE = "its points rise another way than the model"
    GROUND_ABOVE_EAVES = "m above its eaves"
    TERRAIN_UNLIKE_GROUND_POINTS = "the ground points around it"
    TERRAIN_UNLIKE_AROUND = "its own heights around it"
    TERRAIN_WITHOUT_HEIGHTS = "holds values that are no heights"
    GROUND_GIVEN_ELSEWHERE = "the ground given lies"
    ASSUMED_GROUND = "its ground is assumed"
    POINTS_OF_OTHER_CLASSES = "points of other classes lie high above the ground"
    BARE_GROUND = "its ground lies bare"
    BARE_GROUND_INSIDE = "of bare ground inside its footprint"
    GROUND_UNDER_ROOF = "ground points lie under the roof"
    OVERHANGS_LEFT_OUT = "overhangs were left out"

    @property
    def told(self) -> str:
        return self.code.replace("_", " ")


class Change(Coded):
    """What became of a building between two surveys."""

    UNCHANGED = "the new points lie on the earlier roof"
    CHANGED = "the new points lie on another roof"
    NEW = "a building stands where none stood"
    GONE = "bare ground lies where the building stood"
    NOT_COVERED = "the new survey hardly covers the building, or a part of it"
    UNCERTAIN = "the new points neither confirm nor clearly contradict the earlier roof"


class ChangeKind(Coded):
    """What changed of a building."""

    ROOF_RAISED = "the whole roof is higher"
    ROOF_LOWERED = "the whole roof is lower"
    PART_RAISED = "a part of the roof is higher"
    PART_LOWERED = "a part of the roof is lower"
    PART_ADDED = "a part was added"
    PART_REMOVED = "a part was removed"
    TYPE_CHANGED = "the roof has another type"
    SLOPE_CHANGED = "the roof has another slope"
    SMALL_OBJECT = "a small object, such as a dormer or solar panels, was added or removed"
    OUTLINE_CHANGED = "the building has another outline"
    REBUILT = "another building stands there, partly elsewhere"
    MOVED = "the building stands beside its earlier place"
    SPLIT = "its footprint is part of an earlier one"
    MERGED = "its footprint joins earlier ones"
    UNSEEN = "no points of the new survey show whether the roof stands"
    UNCLEAR = "points lie off the roof, on no clear surface"
    EXTENDED = "a roof beside the building lies outside its outline"
    UNMAPPED = "a roof that stood before lies outside all outlines"
    DEMOLISHED = "the building was demolished"
    BUILT = "the building was built"


# Share of roof points within 0.2 m of the roof, below which a building does not count as modelled:
# most of its points contradict the model.
MOSTLY_OFF = 0.5


class Attention(Coded):
    """Why a person should look at a building; `hiproof edit --only` takes these kinds."""

    FAILED = "hiproof failed, or the input of the building is unusable"
    DOUBTFUL = "the model contradicts its points, or stands on too few of them"
    NO_POINTS = "no usable points inside the footprint"
    CHANGED = "the building seems to have changed since its footprint was drawn"


ATTENTION_OF_STATUS = {
    Status.INTERNAL_ERROR: Attention.FAILED,
    Status.BAD_FOOTPRINT: Attention.FAILED,
    Status.NOT_BUILT: Attention.FAILED,
    Status.SIMPLIFIED: Attention.DOUBTFUL,
    Status.FLAT_FALLBACK: Attention.DOUBTFUL,
    Status.FROM_ATTRIBUTES: Attention.NO_POINTS,
    Status.NO_POINTS: Attention.NO_POINTS,
    Status.NO_ROOF: Attention.NO_POINTS,
    Status.NO_BUILDING: Attention.CHANGED,
}
SIGNS_OF_CHANGE = (Doubt.BARE_GROUND, Doubt.BARE_GROUND_INSIDE, Doubt.GROUND_UNDER_ROOF)


def find_attention(
    status: str, quality: str | None, detail: str, share: float | None
) -> tuple[Attention, ...]:
    """Return the kinds of attention that a building needs.

    They follow from what a run writes of it: the codes of its status and grade, its detail and its
    share of roof points within 0.2 m of the roof.

    >>> find_attention("modelled", "good", "modelled", 0.97)
    ()
    >>> find_attention("modelled", "poor", "poor: 12 m2 of bare ground inside its footprint", 0.4)
    (<Attention.DOUBTFUL: ...>, <Attention.CHANGED: ...>)
    """
    known = Status.__members__.get(status.upper())
    kinds = {ATTENTION_OF_STATUS[known]} if known in ATTENTION_OF_STATUS else set()
    if quality == Grade.POOR.code or (share is not None and share < MOSTLY_OFF):
        kinds.add(Attention.DOUBTFUL)
    if any(doubt.value in detail for doubt in SIGNS_OF_CHANGE):
        kinds.add(Attention.CHANGED)
    return tuple(kind for kind in Attention if kind in kinds)
