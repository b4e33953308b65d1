# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The trip matrix: every trip of every installed rig at its threshold by the compiled look at made numbers, and in every state."""

import json

import numpy as np
import pytest

from rig_nodes.base import njit, rig_folders
from rig_nodes.cli.main import main
from rig_nodes.plant import ALL, TRIPPED, World
from rig_nodes.plant.engine.watch import ARRIVED, watched
from rig_nodes.rig import GEAR, STAYED, load_rig, trips_named
from rig_nodes.rig.bench_trips import RULES
from rig_nodes.runs import Rig, RigStatus, plan_of
from rig_nodes.runs.watch import Watched

NOT_YET = -1


@njit(cache=True)
def look(watch, numbers, row, samples):
    """Look for so many samples; return the first in which a trip fires, counted from 0, or NOT_YET."""
    for sample in range(samples):
        if watched(watch, numbers, row, np.ones(len(row))) == TRIPPED:
            return sample
    return NOT_YET


@njit(cache=True)
def both_look(quick, thorough, numbers, row, walk, said):
    """Look at a walk of numbers twice, once with every trip looked at in each sample; return the first sample that differs."""
    noise = np.ones(len(row))
    for sample in range(len(walk)):
        numbers[:] = walk[sample, : len(numbers)]
        row[:] = walk[sample, len(numbers) :]
        quick.said[:2] = thorough.said[:2] = said[sample]
        thorough.witness[:], thorough.counting[0] = ALL, len(thorough.witness)
        for k in range(len(thorough.witness)):
            thorough.counting[k + 1] = k
        same = watched(quick, numbers, row, noise) == watched(thorough, numbers, row, noise)
        for k in range(len(quick.trips)):
            one, other = quick.trips[k], thorough.trips[k]
            same &= one.count == other.count and one.near_count == other.near_count and one.latched == other.latched
            same &= one.counts == other.counts and one.warned == other.warned and (one.counts == 0 or one.base == other.base)
        if not same:
            return sample
    return NOT_YET


def watched_by(trips, world):
    """Trips of a rig whose transducers all have a noise of 1."""
    return Watched(trips, world, np.ones(len(world.plan.channels)))


class Made:
    """One trip of a rig on numbers that are made: the least ones that give its quantity and fulfil its conditions."""

    def __init__(self, trip, world):
        self.trip, self.one = trip, watched_by([trip], world)
        self.numbers, self.row = np.zeros(len(world.numbers)), np.zeros(len(world.plan.channels))
        self.samples = round(trip.delay / 1e-3)

    def hold(self, value, fulfilled=True):
        """Make the trip's quantity a value [SI], and its conditions true or all of them false."""
        watch = self.one.arrays
        sums = [int(watch.trips["sum"][0]), *watch.conditions.tolist()]
        way = watch.trips["way"][0]
        wanted = [way * (value if self.trip.above else -value)]
        for each in self.trip.enabled:
            apart = 0.25 if any(name == GEAR for name, _ in each.sum.terms) else each.threshold
            wanted.append(each.threshold + apart * (1 if each.above == fulfilled else -1))
        terms = [slice(watch.first[k], watch.first[k + 1]) for k in sums]
        places = sorted({int(place) for term in terms for place in watch.places[term]})
        weights = np.zeros((len(sums), len(places)))
        for row, term in zip(weights, terms):
            for place, weight in zip(watch.places[term], watch.weights[term]):
                row[places.index(place)] += weight
        made = np.linalg.lstsq(weights, np.array(wanted), rcond=None)[0]
        if fulfilled:
            assert np.allclose(weights @ made, wanted), f"{self.trip.name}: its conditions and its limit contradict each other"
        for place, number in zip(places, made):
            if place < 0:
                watch.said[[-1 - place, ARRIVED - 1 - place]] = number
            elif place < len(self.numbers):
                self.numbers[place] = number
            else:
                self.row[place - len(self.numbers)] = number

    def look(self, samples):
        return look(self.one.arrays, self.numbers, self.row, samples)


@pytest.fixture(scope="module", params=list(rig_folders()))
def made(request):
    config = load_rig(request.param)
    world = World(plan_of(config).plan)
    return [Made(trip, world) for trip in config.trips if not rests(trip)]


def rests(trip):
    """Whether a trip is one of a reading that stays the same: its quantity grows by itself."""
    return trip.quantity.terms[0][0].startswith(STAYED)


def beyond(trip, share):
    """A value past the limit by a share of it, or short of it by a negative one."""
    return trip.limit * (1.0 + share if trip.above else 1.0 - share)


def test_every_trip_fires_once_its_delay_after_it_crosses_its_limit_and_not_at_one_per_cent_short(made):
    for each in made:
        trip = each.trip
        if trip.rises:
            each.hold(0.0)
            assert each.look(1) == NOT_YET
        each.hold(beyond(trip, -0.01))
        assert each.look(each.samples + 10) == NOT_YET, trip.name
        each.hold(beyond(trip, 0.001))
        assert each.look(each.samples + 10) == each.samples, trip.name
        assert each.one.latched() == (trip,), trip.name
        assert each.one.value(trip) == pytest.approx(beyond(trip, 0.001)), trip.name


def test_a_trip_whose_time_is_not_over_or_that_is_not_enabled_stays_silent(made):
    for each in made:
        each.one.reset()
        if each.samples:
            each.hold(beyond(each.trip, 0.001))
            assert each.look(each.samples) == NOT_YET, each.trip.name
            each.hold(beyond(each.trip, -0.05))
            assert each.look(1) == NOT_YET
            each.hold(beyond(each.trip, 0.001))
            assert each.look(each.samples) == NOT_YET, f"{each.trip.name}: its time went on"
        if each.trip.enabled:
            each.hold(beyond(each.trip, 0.001), fulfilled=False)
            assert each.look(each.samples + 10) == NOT_YET, each.trip.name


def test_a_warning_comes_before_the_trip_once_until_it_is_over(made):
    for each in made:
        trip = each.trip
        if trip.warning is None or trip.rises:
            continue
        each.one.reset()
        each.hold(0.95 * trip.limit)
        assert each.look(each.samples + 1) == NOT_YET
        [(sentence, value)] = each.one.warnings(1.0)
        assert sentence.startswith(f"warning {trip.name}: the {trip.quantity.text} is ") and value == pytest.approx(
            0.95 * trip.limit
        )
        assert each.look(3) == NOT_YET and each.one.warnings(1.0) == []
        each.hold(0.5 * trip.limit)
        each.look(1)
        each.hold(0.95 * trip.limit)
        each.look(each.samples + 1)
        assert len(each.one.warnings(2.0)) == 1, trip.name


@pytest.mark.parametrize("rig", list(rig_folders()))
def test_a_reading_that_stays_the_same_for_its_time_trips_as_dead_or_stuck_and_one_that_scatters_does_not(rig):
    config = load_rig(rig)
    world = World(plan_of(config).plan)
    trips = [trip for trip in config.trips if rests(trip)]
    assert bool(trips) == config.effects.transducers
    for trip in trips:
        name, channel = trip.name.partition("_")[::2]
        one, numbers, row = watched_by([trip], world), np.zeros(len(world.numbers)), np.zeros(len(world.plan.channels))
        place, samples = list(world.plan.channels).index(channel), round(trip.limit / 1e-3)
        for shown in (0.5, 0.25):  # every change begins anew
            row[place] = shown * trip.enabled[-1].threshold
            assert look(one.arrays, numbers, row, samples) == NOT_YET, trip.name
        row[place] = 0.0
        assert look(one.arrays, numbers, row, samples) == NOT_YET, trip.name
        if name == "stuck":
            assert look(one.arrays, numbers, row, 10 * samples) == NOT_YET, f"{trip.name}: it is dead"
            row[place] = 0.5 * trip.enabled[-1].threshold
            assert look(one.arrays, numbers, row, samples) == NOT_YET, trip.name
        assert look(one.arrays, numbers, row, 10) in (0, 1) and one.latched() == (trip,), trip.name


@pytest.mark.parametrize("rig", list(rig_folders()))
def test_trips_that_are_ruled_out_are_those_of_which_nothing_is_true(rig):
    """Numbers wander across all limits and conditions, and the controller changes gear now and then."""
    config = load_rig(rig)
    world = World(plan_of(config).plan)
    quick, thorough = watched_by(config.trips, world), watched_by(config.trips, world)
    random, count = np.random.default_rng(7), len(world.numbers)
    arrays, scale = quick.arrays, np.ones(count + len(world.plan.channels))
    limits = [(one["sum"], one["limit"]) for one in arrays.trips] + list(zip(arrays.conditions, arrays.thresholds[1]))
    for number, limit in limits:
        for term in range(arrays.first[number], arrays.first[number + 1]):
            if arrays.places[term] >= 0:
                scale[arrays.places[term]] = max(1e-3, abs(limit / arrays.weights[term]))
    walk = scale * np.cumsum(random.normal(size=(4000, len(scale))), axis=0) / 40.0
    walk[1000:3000] = walk[1000]  # everything rests for longer than any healthy reading
    walk[1000:3000, count:] *= random.integers(0, 2, len(scale) - count)  # and some readings at 0
    said = np.stack([random.integers(0, 3, 4000 // 50).repeat(50), random.integers(0, 2, 4000 // 25).repeat(25)], axis=1)
    numbers, row = np.zeros(count), np.zeros(len(world.plan.channels))
    assert both_look(quick.arrays, thorough.arrays, numbers, row, walk, said.astype(float)) == NOT_YET


@pytest.mark.parametrize("rig", list(rig_folders()))
def test_in_every_state_each_trip_fires_at_the_next_sample_and_the_red_button_wins_over_it(rig):
    """Each trip in turn gets a limit that every value exceeds, and no condition, on the running rig itself."""
    one, moments = Rig(load_rig(rig), controller="external", level="current"), {}
    for state, on, samples in ((RigStatus.STARTING, 0.0, 0), (RigStatus.READY, 0.0, 2), (RigStatus.RUNNING, 1.0, 2)):
        one.device(one.drive)["enabled"] = on
        if one.shifts and state == RigStatus.READY:
            one.set_current(one.sample, [0.0] * len(one.setpoint), 0, False)
        one.advance_samples(samples)
        if one.status == state:  # without a shift controller no rig waits for commands
            moments[state] = one.snapshot()
    assert moments.keys() >= {RigStatus.READY, RigStatus.RUNNING}
    for state, moment in moments.items():
        for number, trip in enumerate(one.watched.trips):
            one.restore(moment)
            begun, record = one.sample, one.watched.arrays.trips[number]
            record["limit"], record["delay"], record["end"] = -np.inf, 0, record["begin"]
            one.advance_samples(5)
            assert (one.tripped_by, one.sample - begun, one.status) == (trip.name, 1, RigStatus.TRIPPED), (state, trip.name)
            one.e_stop()
            one.trip("later", "other")
            assert (one.tripped_by, one.reason) == ("e_stop", "emergency stop"), (state, trip.name)
            one.reset()
            assert one.tripped_by == one.reason == "" and one.watched.latched() == (), (state, trip.name)


def test_of_several_trips_in_one_sample_all_are_told():
    one = Rig(load_rig("hydmag"))
    one.watched.arrays.trips["limit"][[1, 3]], one.watched.arrays.trips["delay"][[1, 3]] = -np.inf, 0
    names = [one.watched.trips[number].name for number in (1, 3)]
    one.advance_samples(1)
    assert one.tripped_by == names[0] and one.reason.endswith(f"; at the same time trip {names[1]}")
    assert trips_named(one.reason) == names


@pytest.mark.parametrize("rig", ["hydmag", "chain_saw"])
def test_trips_without_a_limit_are_listed_too(rig, capsys):
    """A run's record names one of the listed trips, whatever ended the run, and each has its number on CAN."""
    assert main(["list", "trips", "--rig", rig, "--json", "-"]) == 0
    listed = {row["trip"]: (int(row["SPN"]), int(row["FMI"])) for row in json.loads(capsys.readouterr().out)}
    others = {"e_stop", "device_silent", "process_lost", "ended_early", "stood_still", "no_finite_number", "not_settled"}
    own = {"controller_silent", "controller_failed"} if rig == "hydmag" else set()
    assert listed.keys() == {trip.name for trip in load_rig(rig).trips} | others | own
    assert len(set(listed.values())) == len(listed)


@pytest.mark.parametrize(
    "reason, name",
    [
        ("emergency stop", "e_stop"),
        ("valve commands older than 100 ms: the shift controller is silent", "controller_silent"),
        ("none of the first 101 samples was answered: no frame came", "controller_silent"),
        ("controller python:mine.py:Tcu, sample 300: status error: P0746", "controller_failed"),
        ("the shift controller took more than 1 s for one sample (--step-timeout)", "controller_failed"),
        ("motor: no answer on /motor/cut/answer for 100 ms", "device_silent"),
        ("alfa46 killed by signal 9 (SIGKILL)", "process_lost"),
        ("the rig stood still for 1.20 s of real time", "stood_still"),
        ("the recorder stands still for 1.1 s", "stood_still"),
        ("the rig was ended by hand", "ended_early"),
    ],
)
def test_the_reason_of_a_trip_tells_its_name(reason, name):
    assert trips_named(reason) == [name]


@pytest.mark.parametrize("rig", list(rig_folders()))
def test_every_trip_has_a_number_of_its_own_and_a_source(rig):
    trips = load_rig(rig).trips
    numbers = [trip.spn for trip in trips] + [rule.spn for rule in RULES.values()]
    assert len(set(numbers)) == len(numbers) and min(numbers) >= 520_192 and max(numbers) <= 522_239
    assert all(trip.source for trip in trips) and len({trip.name for trip in trips}) == len(trips)


@pytest.mark.parametrize(
    "settings",
    [
        {"effects.transducers": "off", "effects.current_loop": "off", "trips.overspeed_w0.limit": "900 rpm"},
        {"valve_zr_p1.source": "topic", "instruments.torque_noise": "0 Nm"},
    ],
)
def test_what_is_switched_off_moves_no_number_of_another_trip(settings):
    numbers = {trip.name: trip.spn for trip in load_rig("hydmag").trips}
    left = {trip.name: trip.spn for trip in load_rig("hydmag", settings).trips}
    assert left.keys() < numbers.keys() and left.items() <= numbers.items()
