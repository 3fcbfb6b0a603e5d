"""This module defines when a run is near a periodic orbit, for ordinary and compiled searches."""

CLOSE = 1e-6  # distance in units of the states' scale that is near enough
NEARER = 0.1  # of the first distance: the run has come so much closer
MOST = 32  # periods of the orbit that the run is followed
# A run that has not come so close by then must be where the derivative at the orbit describes the map: Newton's step
# with this derivative leaves at most this part of the distance.
LINEAR = 0.25
