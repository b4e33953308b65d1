# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A rig from Python: loaded by its name, with settings, simulated; users begin with ``rig_nodes.load``."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping, Sequence
from html import escape
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..analysis import modes, write_report
from ..base import MOST_DELAY, STARTING, RigError, atomic_write, brief, not_written, shown_in, waiting
from ..controllers import IN_PROCESS, load_controller
from ..rig import POINT, RigConfig, check_gearbox, driveline_svg, load_rig, with_overrides
from ..runs import Ordered, Session, build_controller_fmu, build_rig_fmu, check_controller, check_level, load_sequence, sequence_of
from .checked import checked
from .exported import export_rig
from .given import path_of, product, seed_of, texts, texts_of, whole
from .run import Run
from .simulated import simulated
from .table import Table
from .temporary import Temporary

if TYPE_CHECKING:
    from ..controllers import Plug

EXTERNAL = "external"  # controller of a session whose commands are set by hand


def load(name: str | Path, /, **settings: Any) -> Rig:
    """Load a rig.

    Parameters
    ----------
    name : str or Path
        Name of an installed rig, a rig's folder, or its file.
    **settings
        Values of the rig in place of its own, named as after ``--set``: texts with a unit, or numbers in SI. A name with a dot
        is given as a dict of its part, or by ``**{"alfa46.t12": "200 ms"}``.

    Returns
    -------
    Rig
        The rig.

    Raises
    ------
    RigError
        When there is no such rig or setting, or a value does not fit.

    Examples
    --------
    >>> rig_nodes.load("hydmag", alfa46={"t12": "-200 ms"})
    rig hydmag: HydmAG two-speed powershift gearbox, DC motor, load pump, valves ZR-P1 and ZR-P2, controller Alfa46
    gears: I 1.382, II 1.025
    devices: ...
    setting: alfa46.t12 = -200 ms
    >>> rig = rig_nodes.load("hydmag", alfa46={"t12": -0.2, "output_1": {"P1": "200 ms 160 mA"}})
    >>> rig.name, rig.config.alfa46.values.t12
    ('hydmag', -0.2)
    >>> rig_nodes.load("hydmag", **{"alfa46.t21": "5 bar"})
    Traceback (most recent call last):
    rig_nodes.base.errors.RigError: setting alfa46.t21=5 bar: the value: '5 bar' is a pressure, expected a time (s, ms, us, min)
    """
    return with_settings(Rig(str(name), load_rig(name), {}), settings)


def rig_from(rig: object) -> Rig:
    """Return a rig that is given as such, or by its name or file; RigError for anything else."""
    if not isinstance(rig, Rig | str | Path):
        raise RigError(f"rig is {brief(rig)}, expected a Rig, its name or its file")
    return rig if isinstance(rig, Rig) else load(rig)


def with_settings(rig: Rig, settings: Mapping[str, Any]) -> Rig:
    """Return a rig with further settings, as of :func:`load`."""
    if not isinstance(settings, Mapping):
        raise RigError(f"settings is {brief(settings)}, expected a dict of names and values")
    texts = {key: rig.text_of(key, value) for key, value in _flat(settings).items()}
    return Rig(rig.source, with_overrides(rig.config, texts), rig.settings | texts)


class Rig:
    """A rig with its settings; :func:`load` makes it.

    Attributes
    ----------
    name : str
        Name of the rig.
    source : str
        Name, folder or file that it was loaded from.
    config : RigConfig
        Its checked configuration.
    settings : dict of str to str
        The settings that were given, as after ``--set``.
    """

    def __init__(self, source: str, config: RigConfig, settings: dict[str, str]) -> None:
        self.name, self.source, self.config, self.settings = config.name, source, config, settings

    def simulate(
        self,
        sequence: str | Path | Sequence[Mapping] | Mapping = "demo",
        *,
        seed: int = 1,
        controller: str | type | None = None,
        level: str | None = None,
        delay: int = 1,
        parameters: Mapping[str, Any] | None = None,
    ) -> Run:
        """Run a sequence, as fast as it goes.

        Parameters
        ----------
        sequence : str, Path, list of dict or dict
            Name of a sequence, its file, or its steps as in a sequence's file, alone or in a dict with ``ready`` and
            ``parameters``.
        seed : int
            Seed of the transducers' noise and errors.
        controller : str or type, optional
            A controller in place of the rig's own, as after ``--controller``, or a class, which then runs in this process.
            Its ``initialize(info)`` receives a ``ControllerInfo``; ``step(inputs)`` receives each millisecond a
            ``ControllerInputs`` and returns a ``ControllerOutputs`` of ``rig_nodes.controllers``, whose help has the fields;
            ``terminate()`` ends it.
        level : str, optional
            What the controller returns, ``"duty"`` or ``"current"``, where it can return both.
        delay : int
            Samples of 1 ms until the controller's answers act.
        parameters : mapping, optional
            Values of the sequence's parameters, as after ``--with``.

        Returns
        -------
        Run
            The run; how it ended is in its ``end``. It is kept in a temporary folder until it is saved.

        Raises
        ------
        RigError
            When the sequence or the controller cannot be read or does not fit the rig.
        KeyboardInterrupt
            After Ctrl-C.

        Examples
        --------
        >>> rig = rig_nodes.load("hydmag")
        >>> steps = [
        ...     {"oil": {"pressure": "4 MPa"}},
        ...     {"wait": {"until": {"signal": "p_p", "above": "3.9 MPa"}}},
        ...     {"shift": {"to": "I"}},
        ...     {"motor": {"speed": "800 rpm"}},
        ...     {"wait": {"for": "1 s"}},
        ... ]
        >>> run = rig.simulate(steps, seed=7)
        >>> bool(run.signals["n_wej"].to("rpm")[-100:].mean() > 700)
        True
        >>> rig.simulate([{"motor": {"speed": "80000 rpm"}}])
        Traceback (most recent call last):
        rig_nodes.base.errors.RigError: step:1: motor.speed is 80000 rpm; the rig takes 0 to 3000 rpm
        """
        given = texts_of("parameters", parameters)
        if isinstance(sequence, str | Path):
            read = load_sequence(sequence, given, self.source, None, self.config)
        else:
            read = sequence_of(sequence, given, self.config, self.source)
        read.check_rig(self.config)
        seed, delay = seed_of(seed), whole("delay", delay, 0, MOST_DELAY)
        plug, spec = self._plug(controller, level, delay)
        with Temporary() as kept:
            report = simulated(kept.folder, Ordered(self.config, self.source, read, seed, delay, spec), controller=plug)
            write_report(kept.folder, report)
        run = Run(kept.folder, report, kept)
        if run.end["state"] == "interrupted":
            raise KeyboardInterrupt(run.end["reason"])
        return run

    def session(self, *, seed: int = 1, controller: str | type | None = None, level: str | None = None, delay: int = 1) -> Session:
        """Return a session, in which one steps the rig by hand.

        Parameters
        ----------
        seed : int
            Seed of the transducers' noise and errors.
        controller : str or type, optional
            As of :meth:`simulate`, or ``"external"`` for currents or duties that are set by hand.
        level : str, optional
            What the controller returns, ``"duty"`` or ``"current"``.
        delay : int
            Samples of 1 ms until the controller's answers act.

        Returns
        -------
        Session
            The session at time 0, with ``advance``, ``set``, ``read``, ``snapshot`` and ``restore``.

        Raises
        ------
        RigError
            When the controller does not fit the rig.

        Examples
        --------
        >>> session = rig_nodes.load("hydmag").session(seed=1)
        >>> session.set("oil", "4 MPa")
        >>> session.set("shift", "I")
        >>> session.advance(0.5)
        >>> start, ends = session.snapshot(), []
        >>> for speed in (50.0, 100.0):
        ...     session.restore(start)
        ...     session.set("motor", speed)
        ...     session.advance(2.0)
        ...     ends.append(round(session.read("n_wej"), -1))
        >>> ends
        [50.0, 100.0]
        """
        seed, delay = seed_of(seed), whole("delay", delay, 0, MOST_DELAY)
        if controller == EXTERNAL:
            chosen = (EXTERNAL, level, delay)
        else:
            plug, _ = self._plug(controller, level, delay)
            chosen = () if plug is None else (plug, level, delay)
        with waiting(STARTING):
            return Session(self.config, seed, *chosen)

    def modes(self, gear: str | None = None, locked: Sequence[str] | None = None) -> Table:
        """Return the natural frequencies and shapes of the driveline, as `rig modes`.

        Parameters
        ----------
        gear : str, optional
            The gear whose clutches are locked, or ``"neutral"``; by default the first.
        locked : sequence of str, optional
            In its place the clutches, brakes and free-wheels that are locked; none for all open.

        Returns
        -------
        Table
            A row for each mode, slowest first: ``frequency_hz`` undamped, ``damping`` as a share of the critical one, and under
            each body's name its amplitude, of which the largest is 1; negative where it turns against the others.

        Raises
        ------
        RigError
            When there is no such gear or clutch, or both are given.

        Examples
        --------
        >>> modes = rig_nodes.load("ural2").modes()
        >>> modes.units["frequency_hz"], bool(modes["frequency_hz"][-1] > 10.0)
        ('Hz', True)
        """
        if gear is not None and not isinstance(gear, str):
            raise RigError(f"gear is {brief(gear)}, expected the name of a gear")
        state = modes.chosen_state(self.config, gear, None if locked is None else texts("locked", locked))
        found = modes.found_in(modes.system_of(self.config), state).modes
        units = {"frequency_hz": "Hz", "damping": "", **dict.fromkeys(found.bodies, "")}
        shapes = modes.sizes(found)
        rows = zip(found.frequencies.tolist(), found.damping.tolist(), *shapes.T.tolist())
        return Table(units, [dict(zip(units, row)) for row in rows])

    def export_fmu(self, file: str | Path, *, fmi: int = 2) -> None:
        """Write the rig with its settings as a co-simulation FMU, as `rig export fmu`; it starts this interpreter.

        Parameters
        ----------
        file : str or Path
            The FMU's file.
        fmi : int
            Version of FMI, 2 or 3.

        Raises
        ------
        RigError
            When the rig cannot be an FMU, or the file cannot be written.

        Examples
        --------
        >>> rig_nodes.load("three_speed").export_fmu("three_speed.fmu", fmi=3)
        """
        build_rig_fmu(product("file", file, "fmu"), self.source, self.settings, _fmi(fmi))

    def export_controller_fmu(
        self, sources: Sequence[str | Path], file: str | Path, *, fmi: int = 2, include: Sequence[str | Path] = ()
    ) -> None:
        """Write a controller in C or C++ for this rig as a co-simulation FMU, as `rig export controller-fmu`.

        Parameters
        ----------
        sources : sequence of str or Path
            The files with the functions of rig_controller.h.
        file : str or Path
            The FMU's file.
        fmi : int
            Version of FMI, 2 or 3.
        include : sequence of str or Path
            Folders of headers.

        Raises
        ------
        RigError
            When the rig has no gears, a source or folder is missing or does not compile, or the file cannot be written.

        Examples
        --------
        >>> rig_nodes.load("hydmag").export_controller_fmu(["my_controller.c"], "my_controller.fmu")
        Traceback (most recent call last):
        rig_nodes.base.errors.RigError: my_controller.c: there is no such file
        """
        for name, paths in (("sources", sources), ("include", include)):
            if isinstance(paths, str) or not isinstance(paths, Sequence):
                raise RigError(f"{name} is {brief(paths)}, expected a list of paths")
        check_gearbox(self.config, "export controller-fmu")
        if not sources:
            raise RigError("export controller-fmu needs the C file of your controller, e.g. my_controller.c")
        folders = [path_of("include", folder) for folder in include]
        for folder in folders:
            if not folder.is_dir():
                raise RigError(f"include {folder}: there is no such folder")
        flags, files = [f"-I{folder}" for folder in folders], [path_of("sources", one) for one in sources]
        build_controller_fmu(files, product("file", file, "controller-fmu"), self.config, _fmi(fmi), flags)

    def export(self, file: str | Path) -> None:
        """Write what a controller outside needs to know of the rig, as `rig export`, of the kind that the file's ending says.

        Parameters
        ----------
        file : str or Path
            The file, which replaces an older one of its kind: .dbc, the CAN database; .csv or .md, the Modbus registers; .h, the
            record of the rig for C and C++.

        Raises
        ------
        RigError
            When there is no such kind, the rig has no gears, or the file cannot be written.

        Examples
        --------
        >>> rig_nodes.load("hydmag").export("registers.csv")
        >>> print(Path("registers.csv").read_text().splitlines()[0])
        address,name,access,type,...
        """
        export_rig(self.config, path_of("file", file))

    def check(self) -> list[str]:
        """Check the rig and the sequences, rows and calibration in its folder, as `rig check`.

        Returns
        -------
        list of str
            A line for each thing that the rig has; where its results would lack, one that begins with ``warning:``.

        Raises
        ------
        RigError
            At the first thing that is not right, with its file and line.

        Examples
        --------
        >>> lines = rig_nodes.load("ural2").check()
        >>> lines[0], [line for line in lines if line.startswith("warning:")]
        ('ural2: ...', [])
        """
        return list(checked(self.source, self.config))

    def draw(self, file: str | Path) -> bool:
        """Write the picture of the driveline, as `rig check --picture`.

        Parameters
        ----------
        file : str or Path
            The file, an .svg.

        Returns
        -------
        bool
            False when the file holds this picture already, and is left alone.

        Raises
        ------
        RigError
            When the file has another ending or cannot be written.

        Examples
        --------
        >>> rig = rig_nodes.load("ural2")
        >>> rig.draw("driveline.svg"), rig.draw("driveline.svg")
        (True, False)
        """
        if path_of("file", file).suffix.lower() != ".svg":
            raise RigError(f"{file}: the picture of a driveline is a file that ends in .svg")
        path, drawn = product("file", file, "svg"), driveline_svg(self.config).encode()
        try:
            if path.is_file() and path.read_bytes() == drawn:  # of an installed rig, whose folder may be another user's
                return False
            atomic_write(path, drawn)
        except OSError as error:
            raise not_written(path, error) from None
        return True

    @property
    def gears(self) -> dict[str, float]:
        """Ratio of each gear by its name, speed of the input over that of the output; empty for a rig without gears."""
        box = self.config.transmission if self.config.structure.gears else None
        return {box.names[number]: ratio for number, ratio in box.ratios.items()} if box else {}

    def __repr__(self) -> str:
        lines = [f"rig {self.name}: {self.config.description}"]
        if self.gears:
            lines.append("gears: " + ", ".join(f"{name} {ratio:.4g}" for name, ratio in self.gears.items()))
        lines.append("devices: " + ", ".join(f"{one.name} ({one.part})" for one in self.config.structure.devices))
        lines += [f"setting: {name} = {text}" for name, text in self.settings.items()]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        lines = "".join(f"<p>{escape(line)}</p>" for line in repr(self).splitlines())
        # an image of its own, so that the picture's styles are not those of every picture in the notebook; wide ones scroll
        source = f"data:image/svg+xml;base64,{b64encode(driveline_svg(self.config).encode()).decode()}"
        picture = f'<img alt="driveline" style="max-width:none" src="{source}">'
        return f'{lines}<div style="overflow-x:auto;background:#fff">{picture}</div>'

    def _plug(self, controller: str | type | None, level: str | None, delay: int) -> tuple[Plug | None, str | None]:
        """Return the plug of a controller and its specification; None twice for the rig's own."""
        if controller is None and level is None and delay == 1:
            return None, None
        spec = spec_of(controller)
        check_controller(self.config)
        plug = load_controller(spec, self.config, level)
        try:
            check_level(self.config, plug.level)
        except RigError:
            plug.close()
            raise
        return plug, spec

    def text_of(self, name: str, value: Any) -> str:
        """Return the value of a setting as after ``--set``.

        Parameters
        ----------
        name : str
            Whole name of the setting.
        value : object
            A text, which stays as it is, a number in SI, a truth value or, for a point of a profile, time [s] and current [A].

        Returns
        -------
        str
            The text.

        Raises
        ------
        RigError
            When the value is nothing of these.

        Examples
        --------
        >>> rig = rig_nodes.load("hydmag")
        >>> rig.text_of("alfa46.t12", -0.2), rig.text_of("alfa46.output_1.P1", (0.2, 0.16))
        ('-0.2 s', '0.2 s 0.16 A')
        """
        if isinstance(value, bool):
            return "on" if value else "off"
        if isinstance(value, str):
            return value
        setting = self.config.settings.get(name)
        if setting is None:
            return str(value)  # which with_overrides refuses
        if setting.dimension == POINT and isinstance(value, Sequence) and len(value) == 2:
            if all(isinstance(one, str) for one in value):
                return " ".join(value)
            if all(isinstance(one, Real) for one in value):
                return f"{float(value[0])!r} s {float(value[1])!r} A"
        try:
            number = float(value)
        except (TypeError, ValueError):
            way = (
                "texts with units or numbers in SI, time and current"
                if setting.dimension == POINT
                else "a text with a unit or a number in SI"
            )
            raise RigError(f"setting {name} is {brief(value)}; expected {way}") from None
        unit, factor = shown_in(setting.dimension) if setting.is_number else ("-", 1.0)
        return f"{number / factor!r} {unit}"


def spec_of(controller: str | type | None) -> str | None:
    """Return a controller as after ``--controller``; a class runs in its caller's process."""
    own = isinstance(controller, type)
    if not own and controller is not None and (not isinstance(controller, str) or not controller):
        raise RigError(f"controller is {brief(controller)}, expected a text as after --controller, or a class of your own")
    return f"python:{controller.__module__}:{controller.__qualname__}{IN_PROCESS}" if own else controller


def _fmi(version: object) -> int:
    if version not in (2, 3):
        raise RigError(f"fmi is {brief(version)}, expected 2 or 3")
    return int(version)


def _flat(settings: Mapping[str, Any], owner: str = "") -> dict[str, Any]:
    """Return nested settings by their names with dots."""
    out: dict[str, Any] = {}
    for name, value in settings.items():
        out |= _flat(value, f"{owner}{name}.") if isinstance(value, Mapping) else {f"{owner}{name}": value}
    return out
