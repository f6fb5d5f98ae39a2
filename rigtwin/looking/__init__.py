"""The gap between a recording and its twin, felt by moving the candidate effects by hand."""

from rigtwin.looking.look import Look
from rigtwin.looking.prediction import Prediction
from rigtwin.looking.slider import Slider

__all__ = ["Look", "Prediction", "Slider"]
