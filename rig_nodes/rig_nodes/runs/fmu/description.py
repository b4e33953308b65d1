# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Makes modelDescription.xml and variables.h of an FMU from one list of variables, for FMI 2.0 and 3.0.

runs.fmu.build uses it; a variable's place in the list is its value reference, in both versions.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

TYPES = {  # type -> (letter in C, element of FMI 2.0, element of FMI 3.0)
    "real": ("r", "Real", "Float64"),
    "integer": ("i", "Integer", "Int32"),
    "boolean": ("b", "Boolean", "Boolean"),
    "string": ("s", "String", "String"),
}
# an integer whose values have words is an enumeration in FMI 3.0; in FMI 2.0, where some importers refuse
# enumerations, it stays an integer with a type that states the words
ENUMERATION = ("e", "Integer", "Enumeration")
KINDS = {"parameter": "p", "input": "i", "output": "o"}
TUNABLE = "t"  # the letter of a parameter that may be set between steps
BASE_UNITS = {  # unit -> its base units
    "1": {},
    "s": {"s": 1},
    "m": {"m": 1},
    "m2": {"m": 2},
    "m3": {"m": 3},
    "A": {"A": 1},
    "Hz": {"s": -1},
    "rad/s": {"rad": 1, "s": -1},
    "rad/s2": {"rad": 1, "s": -2},
    "m/s": {"m": 1, "s": -1},
    "m3/s": {"m": 3, "s": -1},
    "m3/rad": {"m": 3, "rad": -1},
    "kg.m2": {"kg": 1, "m": 2},
    "kg/m3": {"kg": 1, "m": -3},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "N/m": {"kg": 1, "s": -2},
    "N/m3": {"kg": 1, "m": -2, "s": -2},
    "N.s/m": {"kg": 1, "s": -1},
    "N/Pa2": {"kg": -1, "m": 3, "s": 2},
    "m3/Pa": {"kg": -1, "m": 4, "s": 2},
    "1/(N.m)": {"kg": -1, "m": -2, "s": 2},
    "N.m/rad": {"kg": 1, "m": 2, "s": -2, "rad": -1},
    "N.m.s/rad": {"kg": 1, "m": 2, "s": -1, "rad": -1},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "Pa.s": {"kg": 1, "m": -1, "s": -1},
    "Pa/s": {"kg": 1, "m": -1, "s": -3},
    "Pa/A": {"kg": 1, "m": -1, "s": -2, "A": -1},
    "Pa.s/m3": {"kg": 1, "m": -4, "s": -1},
    "degC": {"K": 1, "offset": 273.15},
    "1/K": {"K": -1},
    "J/K": {"kg": 1, "m": 2, "s": -2, "K": -1},
    "W/K": {"kg": 1, "m": 2, "s": -3, "K": -1},
    "m/J": {"kg": -1, "m": -1, "s": 2},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "H": {"kg": 1, "m": 2, "s": -2, "A": -2},
    "V/(A.s)": {"kg": 1, "m": 2, "s": -4, "A": -2},
}
# typical size of inputs and outputs in a test, for importers that scale errors
NOMINALS = {"rad/s": 100.0, "N.m": 100.0, "Pa": 1e6, "J": 1e4, "N": 1e4, "m": 1e-3, "m3/s": 1e-4}
STEP = 1e-3  # default communication step [s]
# as in c/model.h
CATEGORIES = ("logEvents", "logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal")


@dataclass(frozen=True)
class Variable:
    """One variable of an FMU.

    Parameters
    ----------
    name : str
        The variable's name.
    type : str
        A key of TYPES.
    causality : str
        A key of KINDS.
    text : str
        Its description.
    start : float, int, bool, str or None
        Start value of a parameter or an input [SI].
    unit : str
        A key of BASE_UNITS.
    display : (str, float) or None
        The unit that people read, and the factor to it from ``unit``.
    low, high : float or None
        Smallest and largest value.
    tunable : bool
        Whether a parameter may be set between steps.
    words : tuple of (int, str)
        Meaning of each value of an integer that is a state.
    initial_by : tuple of str
        Variables on which an output depends at the initialization; between two steps it depends on none.
    """

    name: str
    type: str
    causality: str
    text: str
    start: float | int | bool | str | None = None
    unit: str = ""
    display: tuple[str, float] | None = None
    low: float | None = None
    high: float | None = None
    tunable: bool = False
    words: tuple[tuple[int, str], ...] = ()
    initial_by: tuple[str, ...] = ()

    @property
    def in_c_and_xml(self) -> tuple[str, str, str]:
        """Its entry of TYPES, or ENUMERATION."""
        return ENUMERATION if self.words else TYPES[self.type]

    @property
    def declared(self) -> str | None:
        """Name of its type in TypeDefinitions, None when it needs none."""
        return f"{self.name}_type" if self.words else None

    @property
    def kind(self) -> str:
        """Its letter in the C text."""
        return TUNABLE if self.tunable else KINDS[self.causality]

    @property
    def variability(self) -> str:
        """Its variability in the words of FMI."""
        if self.causality == "parameter":
            return "tunable" if self.tunable else "fixed"
        return "continuous" if self.type == "real" else "discrete"


def token_of(identifier: str, variables: Sequence[Variable], extra: str = "") -> str:
    """Return the GUID or instantiation token of an FMU.

    Parameters
    ----------
    identifier : str
        The model's identifier.
    variables : sequence of Variable
        The FMU's variables.
    extra : str
        Further text that distinguishes FMUs.

    Returns
    -------
    str
        The token; equal arguments give an equal token, so that an FMU is the same each time.
    """
    text = json.dumps([identifier, extra, *([v.name, v.type, v.causality, v.start] for v in variables)])
    digest = hashlib.sha256(text.encode()).hexdigest()
    return f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}"


def c_header(fmi: int, variables: Sequence[Variable], token: str, defines: dict[str, int]) -> str:
    """Return the text of variables.h, with the content that c/model.h requires.

    Parameters
    ----------
    fmi : int
        2 or 3.
    variables : sequence of Variable
        The FMU's variables.
    token : str
        The GUID or instantiation token.
    defines : dict of str to int
        Further constants.

    Returns
    -------
    str
        C text.
    """
    texts = [v.name for v in variables if v.type == "string"]
    starts = [texts.index(v.name) if v.type == "string" else float(v.start or 0.0) for v in variables]
    lines = [
        "/* Written when the FMU was built (rig_nodes/runs/fmu/description.py). */",
        "#ifndef VARIABLES_H",
        "#define VARIABLES_H",
        f"#define MODEL_TOKEN {json.dumps(token)}",
        f"enum {{ MODEL_COUNT = {len(variables)}, MODEL_TEXTS = {max(1, len(texts))} }};",
    ]
    lines += [f"enum {{ {name} = {value} }};" for name, value in defines.items()]

    def letter(v: Variable) -> str:
        return (v.in_c_and_xml if fmi == 3 else TYPES[v.type])[0]

    for name, letters in (("TYPES", "".join(letter(v) for v in variables)), ("KINDS", "".join(v.kind for v in variables))):
        lines.append(f'static const char MODEL_{name}[] = "{letters}";')
    names = ", ".join(json.dumps(v.name) for v in variables)
    lines += [
        "static const double MODEL_STARTS[] = {" + ", ".join(repr(float(s)) for s in starts) + "};",
        "static const char *const MODEL_NAMES[] = {" + names + "};",
        "#endif",
        "",
    ]
    return "\n".join(lines)


def _attributes(values: dict) -> str:
    """Return XML attributes of the values that are neither None nor empty."""
    return "".join(f" {key}={quoteattr(_word(value))}" for key, value in values.items() if value is not None and value != "")


def _word(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else str(value)


def _units(variables: Sequence[Variable]) -> list[str]:
    lines, displays = [], {"s": {}}  # the unit of time is always there
    for v in variables:
        if v.unit:
            shown = displays.setdefault(v.unit, {})
            if v.display and v.display[0] != v.unit:
                shown[v.display[0]] = v.display[1]
    for unit, shown in displays.items():
        lines.append(f"    <Unit name={quoteattr(unit)}>")
        if unit in BASE_UNITS:  # a controller's own signal may have a unit that is not in the table
            lines.append(f"      <BaseUnit{_attributes(BASE_UNITS[unit])}/>")
        lines += [f"      <DisplayUnit{_attributes({'name': name, 'factor': factor})}/>" for name, factor in shown.items()]
        lines.append("    </Unit>")
    return lines


def _types(fmi: int, variables: Sequence[Variable]) -> list[str]:
    lines = []
    for v in variables:
        if not v.words:
            continue
        meanings = ", ".join(f"{value} {word}" for value, word in v.words)
        if fmi == 3:
            lines += [
                f"    <EnumerationType{_attributes({'name': v.declared, 'description': meanings})}>",
                *(f"      <Item{_attributes({'name': word, 'value': value})}/>" for value, word in v.words),
                "    </EnumerationType>",
            ]
        else:
            limits = {"min": min(value for value, _ in v.words), "max": max(value for value, _ in v.words)}
            lines += [
                f"    <SimpleType{_attributes({'name': v.declared, 'description': meanings})}>",
                f"      <Integer{_attributes(limits)}/>",
                "    </SimpleType>",
            ]
    return ["  <TypeDefinitions>", *lines, "  </TypeDefinitions>"] if lines else []


def _structure(fmi: int, variables: Sequence[Variable]) -> list[str]:
    """Return ModelStructure: no output depends on an input before the next step, and at the initialization only on parameters."""
    place = {v.name: k if fmi == 3 else k + 1 for k, v in enumerate(variables)}
    lines = []
    for element, initial in (("Output", False), ("InitialUnknown", True)):
        unknowns = [
            (place[v.name], " ".join(str(place[name]) for name in v.initial_by) if initial else "")
            for v in variables
            if v.causality == "output"
        ]
        if fmi == 3:
            lines += [f'    <{element} valueReference="{k}" dependencies="{known}"/>' for k, known in unknowns]
        else:
            lines += [
                f"    <{element}s>",
                *(f'      <Unknown index="{k}" dependencies="{known}"/>' for k, known in unknowns),
                f"    </{element}s>",
            ]
    return ["  <ModelStructure>", *lines, "  </ModelStructure>"]


def model_description(
    fmi: int, identifier: str, text: str, variables: Sequence[Variable], token: str, version: str, tool: bool, saves: bool
) -> str:
    """Return modelDescription.xml of FMI 2.0 or 3.0 for co-simulation.

    Parameters
    ----------
    fmi : int
        2 or 3.
    identifier : str
        The model's identifier.
    text : str
        Description of the model.
    variables : sequence of Variable
        The FMU's variables.
    token : str
        The GUID or instantiation token.
    version : str
        Version of rig_nodes.
    tool : bool
        Whether the FMU needs a program that is already installed (needsExecutionTool).
    saves : bool
        Whether the state can be saved and brought back, also as bytes.

    Returns
    -------
    str
        The XML.
    """
    offers = {
        "modelIdentifier": identifier,
        "needsExecutionTool": tool,
        "canHandleVariableCommunicationStepSize": True,
        "canGetAndSetFMUState" if fmi == 3 else "canGetAndSetFMUstate": saves,
        "canSerializeFMUState" if fmi == 3 else "canSerializeFMUstate": saves,
    }
    if fmi == 2:
        offers["canNotUseMemoryManagementFunctions"] = True
    else:
        offers |= {"fixedInternalStepSize": STEP, "mightReturnEarlyFromDoStep": tool}
    text = f"{text}; communication steps are whole multiples of {STEP * 1e3:g} ms"
    head = {
        "fmiVersion": "3.0" if fmi == 3 else "2.0",
        "modelName": identifier,
        "instantiationToken" if fmi == 3 else "guid": token,
        "description": text,
        "version": version,
        "license": "Apache-2.0",
        "generationTool": f"rig_nodes {version}",
        "variableNamingConvention": "structured",
    }
    if fmi == 2:
        head["numberOfEventIndicators"] = 0
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f"<fmiModelDescription{_attributes(head)}>",
        f"  <CoSimulation{_attributes(offers)}/>",
        "  <UnitDefinitions>",
        *_units(variables),
        "  </UnitDefinitions>",
        *_types(fmi, variables),
        "  <LogCategories>",
        *(f'    <Category name="{name}"/>' for name in CATEGORIES),
        "  </LogCategories>",
        f'  <DefaultExperiment startTime="0.0" stopTime="1.0" stepSize="{STEP}"/>',
        "  <ModelVariables>",
    ]
    lines += (_variables3 if fmi == 3 else _variables2)(variables)
    return "\n".join([*lines, "  </ModelVariables>", *_structure(fmi, variables), "</fmiModelDescription>", ""])


def _values(v: Variable) -> dict:
    """Return the attributes that a variable's type has in both versions, without the start."""
    if v.type not in ("real", "integer"):
        return {}
    number = float if v.type == "real" else int
    limits = {key: None if bound is None else number(bound) for key, bound in (("min", v.low), ("max", v.high))}
    if v.type == "integer":
        return limits
    shown = v.display[0] if v.unit and v.display and v.display[0] != v.unit else None
    nominal = NOMINALS.get(v.unit) if v.causality != "parameter" else None
    return {"unit": v.unit, "displayUnit": shown, **limits, "nominal": nominal}


def _start(v: Variable) -> float | bool | str | None:
    """Return the start value as the XML states it; None for outputs."""
    if v.causality == "output":
        return None
    return {"real": float, "integer": int, "boolean": bool, "string": str}[v.type](v.start)


def _variables2(variables: Sequence[Variable]) -> list[str]:
    lines = []
    for k, v in enumerate(variables):
        head = {
            "name": v.name,
            "valueReference": k,
            "causality": v.causality,
            "variability": v.variability,
            "description": v.text,
            "initial": {"parameter": "exact", "output": "calculated"}.get(v.causality),
        }
        start = _start(v)
        # an empty string is a start value too
        tail = f" start={quoteattr(_word(start))}" if start is not None else ""
        lines += [
            f"    <ScalarVariable{_attributes(head)}>",
            f"      <{v.in_c_and_xml[1]}{_attributes({'declaredType': v.declared, **_values(v)})}{tail}/>",
            "    </ScalarVariable>",
        ]
    return lines


def _variables3(variables: Sequence[Variable]) -> list[str]:
    lines = []
    for k, v in enumerate(variables):
        head = {
            "name": v.name,
            "valueReference": k,
            "causality": v.causality,
            "variability": v.variability,
            "description": v.text,
            "initial": {"parameter": "exact", "output": "calculated"}.get(v.causality),
        }
        head["declaredType"] = v.declared
        start, element = _start(v), v.in_c_and_xml[2]
        if v.type == "string" and start is not None:
            lines.append(f"    <{element}{_attributes(head)}><Start value={quoteattr(start)}/></{element}>")
        else:
            lines.append(f"    <{element}{_attributes({**head, **_values(v), 'start': start})}/>")
    return [
        *lines,
        f'    <Float64 name="time" valueReference="{len(variables)}" causality="independent" '
        'variability="continuous" unit="s" description="Simulated time"/>',
    ]
