#!/usr/bin/env python3
# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Release check of the exported FMUs in a co-simulation master: the rig and its controller as two FMUs engage gear I.

    two_fmus.py libcosimpy|ecospy hydmag.fmu alfa46.fmu

It runs in an environment that has the master. See README.md beside it.
"""

import sys

STEP, END = 1e-3, 2.0  # s
MEASURED = ("current_1", "current_2", "current_3", "n_wej", "n_wyj", "p1", "p2")
COMMANDS = ("command_1", "command_2", "command_3")
LEVEL = 1  # current setpoints; the rig's parameter `controller` has them one higher
LOW, HIGH = 2.2e6, 2.5e6  # Pa: clutch S1, closed


def by_libcosimpy(rig, controller):
    """Gear and pressure [Pa] of the engaged clutch, and time reached [s]; libcosim connects by value references."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel.ERROR)
    master = CosimExecution.from_step_size(step_size=STEP * 1e9)
    slaves = [
        master.add_local_slave(CosimLocalSlave(fmu_path=path, instance_name=name))
        for path, name in ((rig, "rig"), (controller, "controller"))
    ]
    place = {}
    for number, slave in enumerate(slaves):
        for variable in master.slave_variables(slave):
            place[number, variable.name.decode()] = slave, variable.reference
    manipulator, observer = CosimManipulator.create_override(), CosimObserver.create_last_value()
    master.add_manipulator(manipulator)
    master.add_observer(observer)

    def link(kind, source, sink):
        getattr(master, f"connect_{kind}_variables")(*place[source], *place[sink])

    for name in MEASURED:
        link("real", (0, name), (1, name))
    for name in COMMANDS:
        link("real", (1, name), (0, name))
    link("boolean", (1, "shifting"), (0, "command_shifting"))
    master.integer_initial_value(*place[0, "controller"], LEVEL + 1)
    master.integer_initial_value(*place[1, "level"], LEVEL)

    def give(kind, where, value):
        slave, reference = place[where]
        getattr(manipulator, f"slave_{kind}_values")(slave, [reference], [value])

    give("integer", (0, "command_gear"), 1)  # libcosimpy 0.0.6 does not connect integers
    give("real", (0, "oil_pressure"), 4e6)
    give("boolean", (0, "oil_enable"), True)
    give("integer", (1, "gear_request"), 1)
    master.simulate_until(END * 1e9)
    (gear,) = observer.last_integer_values(place[1, "gear"][0], [place[1, "gear"][1]])
    (p1,) = observer.last_real_values(place[0, "p1"][0], [place[0, "p1"][1]])
    return gear, p1, master.status().current_time * 1e-9


def by_ecospy(rig, controller):
    """Gear and pressure [Pa] of the engaged clutch, and time reached [s]."""
    from ecospy import EcosSimulation, EcosSimulationStructure

    with EcosSimulationStructure() as structure:
        structure.add_model("rig", rig)
        structure.add_model("controller", controller)
        for name in MEASURED:
            structure.make_real_connection(f"rig::{name}", f"controller::{name}")
        for name in COMMANDS:
            structure.make_real_connection(f"controller::{name}", f"rig::{name}")
        structure.make_int_connection("controller::gear", "rig::command_gear")
        structure.make_int_connection("controller::flags", "rig::command_flags")
        structure.make_bool_connection("controller::shifting", "rig::command_shifting")
        given = {"rig::controller": LEVEL + 1, "controller::level": LEVEL, "controller::gear_request": 1}
        structure.add_parameter_set("start", given | {"rig::oil_pressure": 4e6, "rig::oil_enable": True})
        with EcosSimulation(step_size=STEP, structure=structure) as simulation:
            simulation.init(parameter_set="start")
            simulation.step_until(END)
            found = simulation.get_integer("controller::gear"), simulation.get_real("rig::p1"), simulation.get_time()
            simulation.terminate()
    return found


if __name__ == "__main__":
    masters = {"libcosimpy": by_libcosimpy, "ecospy": by_ecospy}
    if len(sys.argv) != 4 or sys.argv[1] not in masters:
        sys.exit("two_fmus: give libcosimpy or ecospy, the rig's FMU and the controller's FMU")
    gear, p1, time = masters[sys.argv[1]](*sys.argv[2:])
    sound = gear == 1 and LOW < p1 < HIGH
    print(f"{sys.argv[1]}: {'passed' if sound else 'FAILED'}: gear {gear}, p1 {p1 * 1e-6:.2f} MPa after {time:.3f} s")
    sys.exit(0 if sound else 1)
