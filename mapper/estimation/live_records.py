"""Which records of the ledger count in the graph, and for which landmark: merges, retirements and dropped loops."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from .ledger import Box, DepthCentre, DropLoop, Ledger, Link, Loop, Motion, NewLandmark, Record, ScanMatch, Visual


class LiveRecords:
    """Kept up with the ledger, record by record."""

    def __init__(self) -> None:
        self._of_landmark: dict[int, list[int]] = {}  # live landmark -> numbers of its records, its birth first
        self._merged_into: dict[int, int] = {}
        self._links: dict[int, Link] = {}
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
            case DropLoop():
                self._dropped.add(record.record)
                self._links.pop(record.record, None)

    def merge(self, kept: int, absorbed: int, numbers: Iterable[int]) -> None:
        """These measurements of `absorbed`, which has been taken out, and all that may still come count for `kept`."""
        self._merged_into[absorbed] = kept
        self._of_landmark[kept] += numbers

    def take_out(self, landmark: int) -> list[int]:
        """Forgets a landmark; returns the numbers of its records, its birth first."""
        return self._of_landmark.pop(landmark)

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
        return {number: link for number, link in self._links.items() if isinstance(link, Loop)}

    def links(self) -> list[Link]:
        """All measured motions between keyframes."""
        return list(self._links.values())

    def is_dropped(self, number: int) -> bool:
        """Whether a loop closure or visual motion was found wrong."""
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
