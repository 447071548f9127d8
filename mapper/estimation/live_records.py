"""Which records of the ledger count in the graph, and for which landmark: merges, retirements and what was dropped."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from .ledger import Ledger
from .records import (
    Box,
    DepthCentre,
    DropLoop,
    DropMeasurement,
    Link,
    Loop,
    Motion,
    NewLandmark,
    Record,
    Revive,
    ScanMatch,
    Visual,
)


class LiveRecords:
    """Kept up with the ledger, record by record."""

    def __init__(self) -> None:
        self._of_landmark: dict[int, list[int]] = {}  # live landmark -> numbers of its records, its birth first
        self._retired: dict[int, list[int]] = {}  # the same of those that are out of the graph
        self._merged_into: dict[int, int] = {}
        self._links: dict[int, Link] = {}
        self._loops: dict[int, Loop] = {}  # those of them that close loops
        self._dropped: set[int] = set()

    def add(self, number: int, record: Record) -> None:
        """A record was appended under this number."""
        match record:
            case NewLandmark():
                self._of_landmark[record.landmark] = [number]
            case DepthCentre() | Box():
                self._of_landmark[self.owner(record.landmark)].append(number)
            case Motion() | Visual() | ScanMatch() | Loop():
                self._links[number] = record
                if isinstance(record, Loop):
                    self._loops[number] = record
            case DropLoop():
                self._dropped.add(record.record)
                self._links.pop(record.record, None)
                self._loops.pop(record.record, None)
            case DropMeasurement():
                self._dropped.add(record.record)
                for numbers in (*self._of_landmark.values(), *self._retired.values()):
                    if record.record in numbers:
                        numbers.remove(record.record)
            case Revive():
                self._of_landmark[record.landmark] = self._retired.pop(record.landmark)

    def merge(self, kept: int, absorbed: int, numbers: Iterable[int]) -> None:
        """These measurements of `absorbed`, which has been taken out, and all that may still come count for `kept`."""
        self._merged_into[absorbed] = kept
        self._of_landmark[kept] += numbers

    def take_out(self, landmark: int) -> list[int]:
        """Forgets a landmark; returns the numbers of its records, its birth first."""
        return self._of_landmark.pop(landmark)

    def retire(self, landmark: int, numbers: list[int]) -> None:
        """A landmark that was taken out may be revived with these records."""
        self._retired[landmark] = numbers

    def owner(self, landmark: int) -> int:
        """The landmark that this one has been merged into, itself if none."""
        while landmark in self._merged_into:
            landmark = self._merged_into[landmark]
        return landmark

    def landmarks(self) -> dict[int, list[int]]:
        """Landmarks in the graph -> numbers of their records, their birth first."""
        return self._of_landmark

    def loops(self) -> dict[int, Loop]:
        """Loop closures in the graph by their numbers."""
        return dict(self._loops)

    def links(self) -> list[Link]:
        """All measured motions between keyframes."""
        return list(self._links.values())

    def is_dropped(self, number: int) -> bool:
        """Whether a record was found wrong."""
        return number in self._dropped

    def counting(self, ledger: Ledger) -> Iterator[int]:
        """Numbers of all records that count, in the ledger's order."""
        of_landmarks = {number for numbers in self._of_landmark.values() for number in numbers}
        for number, record in enumerate(ledger):
            if isinstance(record, NewLandmark | DepthCentre | Box):
                if number in of_landmarks:
                    yield number
            elif number not in self._dropped:
                yield number
