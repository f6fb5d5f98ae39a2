"""Quarter-car experiments of thesis chapters 6 and 7 (Tables 6.2 and 7.1).

The quarter car is dropped and driven over roads, with a passive, semi-active or active suspension.
"""

from __future__ import annotations

from controllers import Settings, Skyhook, Structure
from experiments.experiment import flat_ground, road_ground
from rigtwin.components import GasSpring, RigPlant
from rigtwin.description.configuration import Configuration
from rigtwin.description.settings import Road, Timing
from rigtwin.simulation.experiment import Experiment

PASSIVE = Settings()
SEMI_ACTIVE = Settings(skyhook=Skyhook.SEMI_ACTIVE, skyhook_damping=200.0)
ACTIVE = Settings(skyhook=Skyhook.ACTIVE, skyhook_damping=200.0)
SUSPENSIONS = {"passive": PASSIVE, "semi-active": SEMI_ACTIVE, "active": ACTIVE}

# Roads of §6.3.2, §6.3.3 and §7.1: the speed, m/s, and the band at that speed, Hz. A road of
# spectral lines `spacing` apart repeats after 1/spacing, in s.
ROAD_1_6 = Road(speed=25 / 3.6, lowest=0.02, highest=1.6, spacing=0.02)
ROAD_10 = Road(speed=15 / 3.6, lowest=0.01, highest=10.0, spacing=0.01)
ROAD_CHAPTER_7 = Road(speed=25 / 3.6, lowest=0.2, highest=1.6, spacing=0.2)

_LONG = Timing(duration=45.0)

GAS = GasSpring(force=120.0, length=0.5, exponent=1.2)
"""Gas spring beside the motor, which emulates the damper and a soft spring.

A stiffer gas spring is unstable with the rig's delays.
"""
ON_GAS = Settings(
    # The preload of 100 N and the gas spring's 120 N press the tyre of 50 kN/m together.
    start=-220.0 / 50_000.0,
    preload=100.0,
    suspension_stiffness=300.0,
    gas_force=GAS.force,
    gas_length=GAS.length,
    gas_exponent=GAS.exponent,
)

EXPERIMENTS = (
    Experiment(
        "drop",
        "passive quarter car dropped, ground at rest",
        "thesis §6.3.1",
        Configuration(),
        flat_ground,
    ),
    Experiment(
        "gas-spring",
        "quarter car on a real gas spring beside the motor, dropped",
        "thesis §3.5, Eq. 3.3",
        Configuration(plant=RigPlant(gas_spring=GAS), controller=ON_GAS),
        flat_ground,
    ),
    Experiment(
        "road1.6",
        "passive quarter car, motorway at 25 km/h, 0.02-1.6 Hz",
        "thesis §6.3.2",
        Configuration(timing=_LONG, road=ROAD_1_6),
        road_ground,
    ),
    Experiment(
        "road10",
        "passive quarter car, motorway at 15 km/h, 0.01-10 Hz",
        "thesis §6.3.3",
        Configuration(timing=_LONG, road=ROAD_10),
        road_ground,
    ),
    *(
        Experiment(
            name,
            f"{name} suspension, motorway at 25 km/h, 0.2-1.6 Hz",
            "thesis §7.1",
            Configuration(controller=settings, timing=_LONG, road=ROAD_CHAPTER_7),
            road_ground,
        )
        for name, settings in SUSPENSIONS.items()
    ),
    *(
        Experiment(
            f"beam-{name}",
            f"{name} suspension under a cross of elastic beams, motorway at 25 km/h",
            "thesis §7.2",
            Configuration(
                controller=settings._replace(structure=Structure.BEAM),
                timing=_LONG,
                road=ROAD_CHAPTER_7,
            ),
            road_ground,
        )
        for name, settings in SUSPENSIONS.items()
    ),
)
