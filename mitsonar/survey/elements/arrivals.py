"""Counts of the arrivals of echoes at elements, and of those for which the vector approximation is in doubt."""

__all__ = ["ArrivalCounts"]

MOST_DOUBTFUL = 0.5                # share of doubtful echoes at which an array is too large for the approximation,
SMALL_ARRAY = 1.0                  # [m] unless it is smaller: then they are traced one by one without a word
FEWEST_JUDGED = 1000               # echoes: fewer say little


class ArrivalCounts:
    """Count arrivals while pings are made.

    Parameters
    ----------
    radius : float [m]
        Of the arrays.
    guard : float [s]
        Expected error of a delay above which an echo is in doubt.

    Attributes
    ----------
    arrivals, lost : int
        Arrivals of echoes at elements, and those among them that no ray brings although one reaches the centre.
    judged, doubtful : int
        Echoes whose expected error was looked at, and those in doubt.
    """

    def __init__(self, *, radius: float, guard: float):
        self.radius, self.guard = radius, guard
        self.arrivals = self.lost = self.judged = self.doubtful = 0

    def count(self, arrivals: int, lost: int = 0) -> None:
        """Count arrivals, and how many of them are lost."""
        self.arrivals, self.lost = self.arrivals + arrivals, self.lost + lost

    def judge(self, echoes: int, doubtful: int) -> None:
        """Count echoes in doubt.

        Raises
        ------
        ValueError
            If they are so many that a large array had better be computed with eigenrays altogether.
        """
        self.judged, self.doubtful = self.judged + echoes, self.doubtful + doubtful
        if self.radius > SMALL_ARRAY and self.doubtful > MOST_DOUBTFUL * max(self.judged, FEWEST_JUDGED):
            raise ValueError(f"the array reaches {self.radius:.3g} m from its centre, too far for the vector "
                             f"approximation here: for {100 * self.doubtful / self.judged:.0f} % of the echoes it may "
                             f"be off by more than {1e9 * self.guard:g} ns, soonest where rays turn or run nearly "
                             "level; take return_path=\"eigenray\", a smaller array or a shorter range")
