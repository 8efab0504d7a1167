"""A name for each family of choices, as a value."""

from __future__ import annotations

from collections.abc import Iterator, Mapping


class Names(Mapping[str, str]):
    """A name for each of some families, hashable: equal where the same families have the same names."""

    def __init__(self, names: Mapping[str, str]) -> None:
        self._names = dict(names)

    def __getitem__(self, family: str) -> str:
        return self._names[family]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __hash__(self) -> int:
        return hash(frozenset(self._names.items()))

    def __repr__(self) -> str:
        return ", ".join(f"{family} {name}" for family, name in self._names.items())

    def but(self, **names: str) -> Names:
        """The same with other names of some families."""
        return Names(self._names | names)
