"""Single-mass experiments of thesis chapters 3 and 4.

A mass rests on a spring and a damper. Its travel is measured from the ground, not from the wheel.
"""

from __future__ import annotations

from controllers import Settings, Travel
from experiments.experiment import flat_ground, road_ground
from rigtwin.description.configuration import Configuration
from rigtwin.description.settings import Road, Safety, Timing
from rigtwin.simulation.experiment import Experiment

# Table 3.4, with the three filter lags of §3.6 in s.
CHAPTER_3 = Settings(
    travel=Travel.GROUND,
    # Static deflection of the tyre, F/k_t, as on the quarter car.
    start=-220.0 / 50_000.0,
    suspension_stiffness=350.0,
    suspension_damping=30.0,
    preload=220.0,
    filter_position=0.004,
    filter_velocity=0.0064,
    filter_force=0.004,
)
CHAPTER_4 = CHAPTER_3._replace(travel=Travel.MODEL, suspension_damping=50.0)

ROOM = Safety(structure=0.3)
"""Wider limit of the structure plate, m.

With some seeds the sag of 72 mm and the long waves of the road exceed the lab's 0.15 m.
"""
ROAD_CHAPTER_3 = Road(speed=65 / 3.6, lowest=0.0158, highest=0.576, spacing=0.0158)
ROAD_CHAPTER_4 = Road(speed=225 / 3.6, lowest=0.1, highest=5.0, spacing=0.1)

EXPERIMENTS = (
    Experiment(
        "single-mass",
        "single mass dropped, ground at rest",
        "thesis §3.6, Table 3.4",
        Configuration(controller=CHAPTER_3, timing=Timing(duration=45.0)),
        flat_ground,
    ),
    Experiment(
        "single-mass-road",
        "single mass dropped, motorway at 65 km/h, 0.0158-0.576 Hz",
        "thesis §3.6, Fig. 3.15",
        Configuration(
            controller=CHAPTER_3, timing=Timing(duration=45.0), road=ROAD_CHAPTER_3, safety=ROOM
        ),
        road_ground,
    ),
    Experiment(
        "friction-road",
        "single mass, road at 225 km/h, 0.1-5 Hz: motor friction at every reversal",
        "thesis ch. 4",
        Configuration(
            controller=CHAPTER_4, timing=Timing(duration=44.0), road=ROAD_CHAPTER_4, safety=ROOM
        ),
        road_ground,
    ),
)
