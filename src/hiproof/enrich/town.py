"""The buildings of a run, their walls, and where these touch.

Each is computed once.
"""

from __future__ import annotations

import functools

from ..model import Building
from .party import PARTY_GAP_M, Contact, find_contacts
from .records import MOST_KEPT, Records
from .walls import Wall, find_walls


class Town:
    """The buildings of a run by number, with walls and contacts."""

    def __init__(self, records: Records, touch_m: float = PARTY_GAP_M) -> None:
        self.records, self.touch_m = records, touch_m
        self.list_walls = functools.lru_cache(MOST_KEPT)(self.find_walls)
        self.list_pair = functools.lru_cache(8 * MOST_KEPT)(self.find_pair)

    def read(self, number: int) -> Building:
        return self.records.read(number)

    def find_walls(self, number: int) -> tuple[Wall, ...]:
        building = self.read(number)
        return () if building.built is None else find_walls(building.solid)

    def find_pair(self, number: int, other: int) -> tuple[Contact, ...]:
        return find_contacts(self.list_walls(number), self.list_walls(other), self.touch_m)

    def list_contacts(self, number: int) -> dict[int, tuple[Contact, ...]]:
        """Return the contacts of a building's walls, by the number of its neighbour.

        A pair is computed in one way only, so that both neighbours have the same areas.
        """
        result = {}
        for other in self.records.find_near(number, self.touch_m):
            if number < other:
                contacts = self.list_pair(number, other)
            else:
                contacts = tuple(contact.swap() for contact in self.list_pair(other, number))
            if contacts:
                result[other] = contacts
        return result

    def lacks_neighbours(self, number: int) -> bool:
        """Return whether a neighbour of a building may lack a model.

        A neighbour within reach has none, or the building is at the run's border.
        """
        near = self.records.find_near(number, self.touch_m)
        return self.records.is_at_border(number) or not self.records.index.modelled[near].all()
