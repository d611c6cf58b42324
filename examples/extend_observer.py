"""An observer of one's own: the largest principal stress in the body over time."""

import numpy as np

from ngswell import Observer


class LargestStress(Observer):
    """`values` [N/mm²]: the largest eigenvalue of the total Cauchy stress at any integration point, a record each."""

    def __init__(self, when=None):
        super().__init__(when)
        self.values = []

    def record(self, problem, time):
        stress = problem.state.output("stress")(problem.points).reshape(-1, 3, 3)
        self.values.append(float(np.linalg.eigvalsh(stress).max()))
