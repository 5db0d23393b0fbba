"""A simulated person who looks at people: attention, eyes, head, lids, and answers to questions.

The model sees only the display. It was fitted to the stare study
(`python -m benchmarks.stare_participants`) and serves every study of looking.
"""

from visavis.people.observer.observer import Observer
from visavis.people.observer.temperament import DEFAULT_POPULATION, Population, Temperament

__all__ = ["DEFAULT_POPULATION", "Observer", "Population", "Temperament"]
