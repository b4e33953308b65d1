"""modelDescription.xml and variables.h of an FMU from one list of variables, for FMI 2.0 and 3.0.

Used by fmu.build; a variable's place in the list is its value reference, in both versions.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

TYPES = {  # type -> (letter in C, element of FMI 2.0, of FMI 3.0)
    "real": ("r", "Real", "Float64"), "integer": ("i", "Integer", "Int32"), "boolean": ("b", "Boolean", "Boolean"),
    "string": ("s", "String", "String"),
}
KINDS = {"parameter": "p", "input": "i", "output": "o"}
TUNABLE = "t"  # the letter of a parameter that may be set between steps
# unit -> its base units; others are named without
BASE_UNITS = {
    "N.m": {"kg": 1, "m": 2, "s": -2}, "rad/s": {"rad": 1, "s": -1}, "Pa": {"kg": 1, "m": -1, "s": -2}, "A": {"A": 1},
    "degC": {"K": 1, "offset": 273.15}, "m3/s": {"m": 3, "s": -1}, "J": {"kg": 1, "m": 2, "s": -2},
    "N": {"kg": 1, "m": 1, "s": -2}, "m": {"m": 1}, "s": {"s": 1}, "Hz": {"s": -1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
}


@dataclass(frozen=True)
class Variable:
    """One variable. type: a key of TYPES; causality: a key of KINDS; start: of parameters and inputs, SI.

    display: (unit that people read, factor from ``unit``). tunable: a parameter that may be set between steps.
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

    @property
    def kind(self) -> str:
        """Its letter in C."""
        return TUNABLE if self.tunable else KINDS[self.causality]

    @property
    def variability(self) -> str:
        if self.causality == "parameter":
            return "tunable" if self.tunable else "fixed"
        return "continuous" if self.type == "real" else "discrete"


def token_of(identifier: str, variables: Sequence[Variable], extra: str = "") -> str:
    """The GUID or instantiation token: equal for equal variables, so that an FMU is the same each time."""
    text = json.dumps([identifier, extra, *([v.name, v.type, v.causality, v.start] for v in variables)])
    digest = hashlib.sha256(text.encode()).hexdigest()
    return f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}"


def c_header(variables: Sequence[Variable], token: str, defines: dict[str, int]) -> str:
    """variables.h: what c/model.h says it holds."""
    texts = [v.name for v in variables if v.type == "string"]
    starts = [texts.index(v.name) if v.type == "string" else float(v.start or 0.0) for v in variables]
    lines = ["/* Written when the FMU was built (rig_nodes/fmu/description.py). */", "#ifndef VARIABLES_H",
             "#define VARIABLES_H", f"#define MODEL_TOKEN {json.dumps(token)}",
             f"enum {{ MODEL_COUNT = {len(variables)}, MODEL_TEXTS = {max(1, len(texts))} }};"]
    lines += [f"enum {{ {name} = {value} }};" for name, value in defines.items()]
    for name, letters in (("TYPES", "".join(TYPES[v.type][0] for v in variables)),
                          ("KINDS", "".join(v.kind for v in variables))):
        lines.append(f'static const char MODEL_{name}[] = "{letters}";')
    names = ", ".join(json.dumps(v.name) for v in variables)
    lines += ["static const double MODEL_STARTS[] = {" + ", ".join(repr(float(s)) for s in starts) + "};",
              "static const char *const MODEL_NAMES[] = {" + names + "};", "#endif", ""]
    return "\n".join(lines)


def _attributes(values: dict) -> str:
    """XML attributes of those values that are given."""
    return "".join(f" {key}={quoteattr(_word(value))}" for key, value in values.items()
                   if value is not None and value != "")


def _word(value) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else str(value)


def _units(variables: Sequence[Variable]) -> list[str]:
    lines, displays = [], {}
    for v in variables:
        if v.unit:
            shown = displays.setdefault(v.unit, {})
            if v.display and v.display[0] != v.unit:
                shown[v.display[0]] = v.display[1]
    for unit, shown in displays.items():
        lines.append(f"    <Unit name={quoteattr(unit)}>")
        if unit in BASE_UNITS:
            lines.append(f"      <BaseUnit{_attributes(BASE_UNITS[unit])}/>")
        lines += [f"      <DisplayUnit{_attributes({'name': name, 'factor': factor})}/>"
                  for name, factor in shown.items()]
        lines.append("    </Unit>")
    return lines


def model_description(fmi: int, identifier: str, text: str, variables: Sequence[Variable], token: str, version: str,
                      tool: bool, step: float = 1e-3) -> str:
    """modelDescription.xml of FMI 2.0 or 3.0 for co-simulation.

    tool: the FMU needs a program that is installed already (needsExecutionTool). step: [s], the default one.
    """
    offers = {"modelIdentifier": identifier, "needsExecutionTool": tool, "canHandleVariableCommunicationStepSize": True,
              "canGetAndSetFMUState" if fmi == 3 else "canGetAndSetFMUstate": False}
    if fmi == 2:
        offers["canNotUseMemoryManagementFunctions"] = True
    head = {"fmiVersion": "3.0" if fmi == 3 else "2.0", "modelName": identifier,
            "instantiationToken" if fmi == 3 else "guid": token, "description": text, "version": version,
            "license": "Apache-2.0", "generationTool": f"rig_nodes {version}", "variableNamingConvention": "structured"}
    if fmi == 2:
        head["numberOfEventIndicators"] = 0
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', f"<fmiModelDescription{_attributes(head)}>",
             f"  <CoSimulation{_attributes(offers)}/>",
             "  <UnitDefinitions>", *_units(variables), "  </UnitDefinitions>",
             f'  <DefaultExperiment startTime="0.0" stopTime="1.0" stepSize="{step}"/>', "  <ModelVariables>"]
    lines += (_variables3 if fmi == 3 else _variables2)(variables)
    outputs = [k for k, v in enumerate(variables) if v.causality == "output"]
    lines += ["  </ModelVariables>", "  <ModelStructure>"]
    if fmi == 3:
        lines += [f'    <{element} valueReference="{k}"/>' for element in ("Output", "InitialUnknown") for k in outputs]
    else:
        for element in ("Outputs", "InitialUnknowns"):
            lines += [f"    <{element}>", *(f'      <Unknown index="{k + 1}"/>' for k in outputs), f"    </{element}>"]
    return "\n".join([*lines, "  </ModelStructure>", "</fmiModelDescription>", ""])


def _values(v: Variable) -> dict:
    """Attributes that a variable's type takes in both versions, but for its start."""
    if v.type not in ("real", "integer"):
        return {}
    number = float if v.type == "real" else int
    limits = {key: None if bound is None else number(bound) for key, bound in (("min", v.low), ("max", v.high))}
    if v.type == "integer":
        return limits
    shown = v.display[0] if v.unit and v.display and v.display[0] != v.unit else None
    return {"unit": v.unit, "displayUnit": shown, **limits}


def _start(v: Variable):
    """The start value as XML says it; None for outputs."""
    if v.causality == "output":
        return None
    return {"real": float, "integer": int, "boolean": bool, "string": str}[v.type](v.start)


def _variables2(variables: Sequence[Variable]) -> list[str]:
    lines = []
    for k, v in enumerate(variables):
        head = {"name": v.name, "valueReference": k, "causality": v.causality, "variability": v.variability,
                "description": v.text, "initial": {"parameter": "exact", "output": "calculated"}.get(v.causality)}
        start = _start(v)
        # an empty string is a start value too
        tail = f" start={quoteattr(_word(start))}" if start is not None else ""
        lines += [f"    <ScalarVariable{_attributes(head)}>",
                  f"      <{TYPES[v.type][1]}{_attributes(_values(v))}{tail}/>", "    </ScalarVariable>"]
    return lines


def _variables3(variables: Sequence[Variable]) -> list[str]:
    lines = []
    for k, v in enumerate(variables):
        head = {"name": v.name, "valueReference": k, "causality": v.causality, "variability": v.variability,
                "description": v.text, "initial": {"parameter": "exact", "output": "calculated"}.get(v.causality)}
        start, element = _start(v), TYPES[v.type][2]
        if v.type == "string" and start is not None:
            lines.append(f"    <{element}{_attributes(head)}><Start value={quoteattr(start)}/></{element}>")
        else:
            lines.append(f"    <{element}{_attributes({**head, **_values(v), 'start': start})}/>")
    return [*lines, f'    <Float64 name="time" valueReference="{len(variables)}" causality="independent" '
                    'variability="continuous" description="Simulated time [s]"/>']
