"""A look at the gap between a recording and its twin, while candidate effects are moved by hand."""

from rigtwin.looking.look import Look
from rigtwin.looking.prediction import Prediction
from rigtwin.looking.slider import Slider

__all__ = ["Look", "Prediction", "Slider"]
