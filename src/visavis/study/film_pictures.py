"""Which pictures of a film were there while it was shown, by the frames that were lit."""

from collections.abc import Sequence

from visavis.lab.clock import NS_PER_S
from visavis.protocol.plan.steps import Scalar
from visavis.stimuli.film_file import FilmFacts


class FilmPictures:
    """Note the pictures of films that began together at `since_ns`, frame by frame."""

    def __init__(self, films: Sequence[FilmFacts], since_ns: int) -> None:
        self._films, self._since_ns = films, since_ns
        self._seen_indices: list[set[int]] = [set() for _ in films]

    def note(self, t_ns: int) -> None:
        """Note what a frame showed that was lit from a time on."""
        for film, pictures in zip(self._films, self._seen_indices, strict=True):
            pictures.add(film.index_at((t_ns - self._since_ns) / NS_PER_S))

    def columns(self, name: str) -> dict[str, Scalar | None]:
        """Return how many pictures were shown, and how many that were due never were; nothing of a
        showing without a film.
        """
        if not self._films:
            return {}
        seen_by_film = [pictures for pictures in self._seen_indices if pictures]
        shown_count = sum(map(len, seen_by_film))
        due = sum(max(pictures) + 1 for pictures in seen_by_film)
        return {f"{name}_film_pictures": shown_count, f"{name}_film_dropped": due - shown_count}
