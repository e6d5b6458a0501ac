"""Models in closed form, that fits are tested on."""
import numpy as np


class Line:
    """A linearisation that is a matrix, over one parameter ``x``."""

    def __init__(self, value, matrix, shape, backward=None):
        self.value, self.matrix, self.shape = value, matrix, shape
        self.other = matrix if backward is None else backward

    def forward(self, tangents):
        return self.matrix @ np.ravel(tangents["x"])

    def backward(self, cotangent):
        return {"x": (self.other.T @ cotangent).reshape(self.shape)}


class Matrix:
    """y = A x."""

    def __init__(self, matrix, shape=None, backward=None):
        self.matrix, self.other = matrix, backward
        self.shape = shape or (matrix.shape[1],)
        self.start, self.units = {"x": np.zeros(self.shape)}, {"x": "m"}
        self.asked = 0

    def value(self, values):
        self.asked += 1
        return self.matrix @ np.ravel(values.get("x", self.start["x"]))

    def linearised(self, values):
        return Line(self.value(values), self.matrix, self.shape, self.other)


class Exponential(Matrix):
    """y = exp(A x): intensities of levels."""

    def value(self, values):
        return np.exp(super().value(values))

    def linearised(self, values):
        value = self.value(values)
        return Line(value, value[:, None] * self.matrix, self.shape)
