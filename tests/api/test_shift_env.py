# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The environment of gymnasium: its rules, its bits, its rewards, and what ends an episode."""

import subprocess
import sys
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import rig_nodes
from rig_nodes.analysis import metric_keys
from rig_nodes.base import RigError
from rig_nodes.rig import load_rig
from rig_nodes.runs import load_sequence, record

NAME = "rig_nodes/Shift-v0"
LOOKED_FOR = "import rig_nodes, importlib.util\nassert importlib.util.find_spec('gymnasium')\nimport gymnasium"


@pytest.fixture(scope="module")
def profiles():
    return gymnasium.make(NAME, actions="profile")


@pytest.fixture(scope="module")
def currents():
    return gymnasium.make(NAME)


@pytest.fixture(scope="module")
def runs():
    """Runs of the demo by seed, as simulate records them."""
    config = load_rig("hydmag")
    sequence = load_sequence("demo", config=config, rig="hydmag")
    return {seed: record(config, sequence, seed).recording for seed in (5, 6)}


@pytest.mark.parametrize("first", ["import rig_nodes, gymnasium", "import gymnasium, rig_nodes", LOOKED_FOR])
def test_gymnasium_knows_it_in_whichever_order_both_are_imported(first):
    code = f"{first}\nprint(gymnasium.spec('{NAME}').entry_point)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["rig_nodes.api.shift_env:ShiftEnv"]


@pytest.mark.parametrize("actions", ["currents", "profile"])
def test_it_keeps_the_rules_of_gymnasium(actions):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*symmetric and normalized")  # they are amperes and seconds
        check_env(gymnasium.make(NAME, actions=actions).unwrapped, skip_render_check=True)


def assert_same_rows(env, recording):
    """The rows from the order to the end of the episode are those of the run, bit for bit."""
    rig = env.session.rig
    end = rig.sample * rig.rows_per_sample
    first = end - 15_000 + 1
    rows = rig.rows_at(rig.row_period, first, 15_000)
    for name in recording.channels:
        assert np.array_equal(rows[:, rig.channels.index(name)], recording.channels[name][first : end + 1]), name


def test_a_vector_of_them_with_seed_k_is_simulate_with_seed_k_and_the_next(runs):
    several = gymnasium.make_vec(NAME, num_envs=2, vectorization_mode="sync", actions="profile")
    seen, info = several.reset(seed=5)
    assert info["seed"].tolist() == [5, 6]
    members = [one.unwrapped for one in several.envs]
    for member, row, (seed, recording) in zip(members, seen, runs.items()):
        at = round(member.session.time * 1e4)
        assert row.tolist()[:4] == [recording.channels[name][at] for name in member.transducers[:4]], seed
    own = np.array([member.own_profile() for member in members])
    _, _, ended, _, info = several.step(own)
    for member, recording in zip(members, runs.values()):
        assert_same_rows(member, recording)
    assert ended.all() and info["metrics"]["valid"].all() and info["metrics"]["k"].dtype == float
    _, reward, ended, _, info = several.step(own)  # which begins anew, with seeds of its own
    assert not ended.any() and reward.tolist() == [0.0, 0.0] and not {5, 6} & {*info["seed"].tolist()}
    own[0, -1] = 0.2  # s by which the new clutch comes too late
    _, reward, ended, _, info = several.step(own)
    assert ended.all() and reward[0] == -10.0 and info["reason"][0].startswith("n_wyj is ") and info["reason"][1] is None
    assert info["metrics"]["valid"].tolist() == [False, True] and 0.5 < info["metrics"]["t_c_s"][1] < 0.8


def test_members_in_processes_of_their_own_do_the_same():
    vectors = [gymnasium.make_vec(NAME, num_envs=2, vectorization_mode=mode, actions="profile") for mode in ("sync", "async")]
    begun = [several.reset(seed=5)[0] for several in vectors]
    actions = np.array([one.unwrapped.own_profile() for one in vectors[0].envs])
    actions[0, -1] = 0.2
    ended = [several.step(actions) for several in vectors]
    vectors[1].close()
    assert np.array_equal(*begun) and all(np.array_equal(*pair) for pair in list(zip(*ended))[:4])
    assert ended[0][4]["reason"].tolist() == ended[1][4]["reason"].tolist() and len(ended[1][4]["metrics"]["k"]) == 2


def test_why_a_shift_is_not_valid_is_a_sentence_and_its_metrics_are_cells_of_a_table():
    env = gymnasium.make(NAME, actions="profile", window=0.3)  # it takes 0.7 s
    env.reset(seed=1)
    _, reward, _, _, info = env.step(env.unwrapped.own_profile())
    assert reward == -10.0 and isinstance(info["reason"], str) and info["metrics"]["valid"] is False
    assert {type(cell) for cell in info["metrics"].values()} <= {float, str, bool}
    assert {*info["metrics"]} <= {*metric_keys(), "quality"} - {"why", "undefined"}


def test_currents_as_the_alfa46_gives_them_make_its_shift(runs):
    """With steps of a millisecond the agent repeats what the Alfa46 ordered, from the record of its run."""
    env = gymnasium.make(NAME, step=0.001).unwrapped
    config = load_rig("hydmag")
    run = record(config, load_sequence("demo", config=config, rig="hydmag"), 5, plant_states=("I_set_zr_p1", "I_set_zr_p2"))
    set_to = [run.plant_states[name][::10] for name in ("I_set_zr_p1", "I_set_zr_p2")]
    env.reset(seed=5)
    terminated = False
    while not terminated:
        sample = env.session.rig.sample + 1
        _, _, terminated, _, info = env.step(np.array([one[sample] for one in set_to]))
    assert_same_rows(env, run.recording)
    assert info["metrics"]["valid"] and (info["metrics"]["from_gear"], info["metrics"]["to_gear"]) == ("I", "II")


@pytest.mark.parametrize("action", [[0.1], [0.1, np.nan], [[0.1, 0.1]]])
def test_an_action_of_another_shape_or_without_a_value_is_refused(currents, action):
    currents.reset(seed=1)
    with pytest.raises(RigError, match="^action is .*, expected 2 numbers: valve_zr_p1, valve_zr_p2$"):
        currents.unwrapped.step(np.array(action))


def test_the_same_seed_and_actions_give_the_same_episode(currents):
    def episode():
        currents.reset(seed=9)
        return [currents.step(np.array([0.7 - 0.05 * k, 0.05 * k]))[:2] for k in range(10)]

    for (seen, reward), (again, reward_again) in zip(episode(), episode()):
        assert np.array_equal(seen, again) and reward == reward_again


def test_observations_are_what_the_transducers_show(currents):
    seen, _ = currents.reset(seed=2)
    env = currents.unwrapped
    assert seen.tolist() == [env.session.read(name) for name in env.transducers]
    assert seen[env.transducers.index("p1")] != env.session.true("p1")


def test_the_reward_is_made_of_the_metrics(profiles):
    def reward(**weights):
        env = gymnasium.make(NAME, actions="profile", weights=weights)
        env.reset(seed=1)
        _, reward, _, _, info = env.step(env.unwrapped.own_profile())
        return reward, info["metrics"]

    found, metrics = reward(k=2.0, t_c_s=-3.0)
    assert found == pytest.approx(2.0 * metrics["k"] - 3.0 * metrics["t_c_s"])
    lost, metrics = reward(e_loss_j=-1.0)  # from the order to the end of the window, so beyond the end of the slip too
    assert -lost == pytest.approx(metrics["e_loss_settled_j"], rel=0.2)


def test_a_shift_that_is_not_made_is_punished_with_its_reason(currents):
    currents.reset(seed=1)
    terminated, steps = False, 0
    while not terminated:
        _, reward, terminated, _, info = currents.step(np.array([0.74, 0.0]))
        steps += 1
    assert steps < 150 and reward == -10.0 and info["reason"].startswith("the rig tripped: trip slip_in_gear_II_clutch_s2")


def test_an_interrupted_drive_ends_the_episode():
    env = gymnasium.make(NAME)
    env.reset(seed=1)
    terminated, steps = False, 0
    while not terminated:
        _, reward, terminated, _, info = env.step(np.array([0.0, 0.0]))
        steps += 1
    assert steps < 150 and reward == -10.0 and info["reason"].startswith("n_wyj is")


def test_a_limit_of_ones_own_ends_the_episode():
    env = gymnasium.make(NAME, actions="profile", limits={"M_wej": (-500.0, 90.0)})
    env.reset(seed=1)
    _, reward, terminated, _, info = env.step(env.unwrapped.own_profile())
    assert terminated and reward == -10.0 and "M_wej is" in info["reason"] and "beyond its limit" in info["reason"]


@pytest.mark.parametrize("most, ended", [(250.0, True), (280.0, False)])
def test_a_peak_within_a_step_is_beyond_the_limit_too(most, ended):
    env = gymnasium.make(NAME, actions="profile", limits={"M_wej": (-500.0, most)})
    env.reset(seed=1)
    _, _, _, _, info = env.step(env.unwrapped.own_profile())  # highest 266 Nm, at its end below 100
    assert ("beyond its limit" in info.get("reason", "")) == ended


@pytest.mark.parametrize(
    "options,sentence",
    [
        ({"actions": "torque"}, "actions is 'torque', expected 'currents' or 'profile'"),
        ({"way": "I-III"}, "there is no shift 'I-III'; did you mean 'I-II'"),
        ({"rig": "ural2"}, "'ural2' has no shift controller"),
        ({"way": ["I-II"]}, "there is no shift .*; did you mean 'I-II'"),
        ({"step": 0.0015}, "step is 0.0015, expected a time in s, whole milliseconds from 0.001 to 1.5"),
        ({"step": "x"}, "step is 'x', expected a time in s"),
        ({"step": None}, "step is None, expected a time in s"),
        ({"window": [1.0]}, "window is .1.0., expected a time in s"),
        ({"window": 3.0}, "window is 3.0, expected a time in s, whole milliseconds from 0.001 to 1.7"),
        ({"weights": [1.0]}, "weights is .1.0., expected a number by the key of a metric"),
        ({"weights": {"k": "x"}}, "weights: k is 'x', expected a number"),
        ({"weights": {"k": float("nan")}}, "weights: k is nan, expected a number"),
        ({"limits": [1.0]}, "limits is .1.0., expected the lowest and highest reading by the name of a transducer"),
        ({"limits": {"M_wej": 3.0}}, "limits: M_wej is 3.0, expected two numbers, the lower one first"),
        ({"limits": {"M_wej": ("a", 1.0)}}, "limits: M_wej is .*, expected two numbers, the lower one first"),
        ({"limits": {"M_wej": (5.0, 1.0)}}, "limits: M_wej is .*, expected two numbers, the lower one first"),
        ({"weights": {"t_x": 1.0}}, "there is no metric 't_x'"),
        ({"limits": {"M_x": (0.0, 1.0)}}, "there is no transducer 'M_x'"),
        ({"sequence": "coast_down"}, "sequence 'coast_down' orders no shift I-II"),
    ],
)
def test_wrong_arguments_are_refused_in_a_sentence(options, sentence):
    with pytest.raises(RigError, match=sentence):
        gymnasium.make(NAME, **options)


def test_a_loaded_rig_with_settings_is_taken():
    rig = rig_nodes.load("hydmag", **{"alfa46.t12": "-100 ms"})
    assert gymnasium.make(NAME, rig=rig, actions="profile").unwrapped.own_profile()[-1] == pytest.approx(-0.1)
