"""Sources that rays are traced from, and how they stand for transmit elements."""
from dataclasses import dataclass

import numpy as np

__all__ = ["Fans"]


@dataclass(frozen=True, kw_only=True)
class Fans:
    """Sources that rays are traced from, and how they stand for the transmit elements.

    Attributes
    ----------
    position : (S, 3) [m]
        Body frame.
    share : (S, T)
        Of every transmit element's echoes that each source's rays bring; columns add to one.
    """

    position: np.ndarray
    share: np.ndarray

    @classmethod
    def from_centre(cls, transmit):
        """One fan from the array's centre: all elements light the same scatterers."""
        return cls(position=np.zeros((1, 3)), share=np.ones((1, transmit.elements)))

    @classmethod
    def from_elements(cls, transmit):
        """A fan from every transmit element."""
        return cls(position=transmit.position, share=np.eye(transmit.elements))

    @classmethod
    def interpolated(cls, transmit, count):
        """A few fans along the array; elements between take both neighbours' rays, the nearer one's more.

        Parameters
        ----------
        transmit : Array
        count : int
            At least 2.

        Raises
        ------
        ValueError
            If elements stand so unevenly that a fan would stand for none.
        """
        centred = transmit.position - transmit.position.mean(0)
        along = centred @ np.linalg.svd(centred, full_matrices=False)[2][0]
        if np.ptp(along) == 0 or count >= transmit.elements:
            return cls.from_elements(transmit)
        place = (along - along.min()) / np.ptp(along) * (count - 1)
        share = np.maximum(1 - np.abs(place[None] - np.arange(count)[:, None]), 0)
        total = share.sum(1, keepdims=True)
        if not total.all():
            raise ValueError(f"{count} fans were asked for, but some would stand for no element; take fewer")
        # a fan starts amid the elements it stands for: of a planar array, amid those equally far along
        return cls(position=share @ transmit.position / total, share=share)
