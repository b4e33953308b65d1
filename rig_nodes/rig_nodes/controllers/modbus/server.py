# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The plug for a controller that is a Modbus TCP client, such as a PLC: ``modbus:PORT``; the rig is the server.

load.py makes it; pymodbus is imported only then. The registers are those of registers.py; the server listens on
127.0.0.1 unless another host is given. Of several clients the first one that writes is the master; the others may read.
"""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections import Counter, deque
from typing import TYPE_CHECKING

from ...base import RigError, optional
from ..free_running import FreeRunning, split_options, timeout_of
from ..plug import error_text
from ..seam import ControllerInputs
from ..wire import commands, values_of
from ..wire import given as given_wires
from . import registers

if TYPE_CHECKING:
    from collections.abc import Callable

    from pymodbus.pdu import ModbusPDU
    from pymodbus.server import ModbusTcpServer

    from ...rig import RigConfig

OPTIONS = ("host", "timeout")
READING, WRITING = (3, 4, 23), (6, 16, 23)  # function codes; 23 does both
CODE, NO_CODE = 7, 0x80  # place of the function code in a request; code of an exception without a function
ILLEGAL_FUNCTION, BUSY = 1, 6  # exceptions; "server device busy": another client is the master
PROTOCOL = slice(2, 4)  # place of the protocol's number in a request, which is 0
START = 10.0  # s that the server may take to listen


class Modbus(FreeRunning):
    """A controller that reads and writes the rig's registers.

    Options: host (address to listen on, default 127.0.0.1), timeout [s].
    """

    def __init__(self, rest: str, config: RigConfig, level: str | None = None) -> None:
        name = f"modbus:{rest}"
        port, options = split_options(rest, name, OPTIONS)
        host = options.get("host", "127.0.0.1")
        if not port.isdigit() or not 1 <= int(port) <= 65535:
            raise RigError(f"controller {name}: '{port}' is no port; expected modbus:PORT, e.g. modbus:5020")
        super().__init__(name, config, level, f"Modbus TCP {host}:{port}", timeout_of(options, name))
        self._wires, self._commands = given_wires(self.rig_record), commands(self.rig_record, self.level)
        self._own_registers = 1 + len(self._commands) + len(registers.STATE)  # registers of a command
        self._shown = [0] * registers.COMMAND_BASE
        self._written: list[int] | None = None
        self._heartbeat: int | None = None
        self._asking = ""  # the client whose request is served now
        self._refused: deque[str] = deque(maxlen=1)  # a client that wrote without being the master
        self._unused: Counter[str] = Counter()  # what else came and is not used, since the newest sample
        self._bell = threading.Condition()
        self._start(host, int(port), name)

    # ---- the server, in a thread with an event loop of its own

    def _maker(self, host: str, port: int, name: str) -> Callable[[], ModbusTcpServer]:
        """Return what makes the server when it is called in the server's event loop; RigError without pymodbus."""
        optional("pymodbus", "plugs")
        from pymodbus.pdu import ExceptionResponse
        from pymodbus.server import ModbusTcpServer
        from pymodbus.server.requesthandler import ServerRequestHandler
        from pymodbus.simulator import DataType, SimData, SimDevice

        logging.getLogger("pymodbus").setLevel(logging.CRITICAL)
        device = SimDevice(
            0,
            [
                SimData(0, values=[0] * registers.COMMAND_BASE, datatype=DataType.REGISTERS, readonly=True),
                SimData(registers.COMMAND_BASE, values=[0] * self._own_registers, datatype=DataType.REGISTERS),
            ],
            action=self._access,
        )

        plug = self

        class Client(ServerRequestHandler):
            """A connection; it refuses functions missing in docs/how_to/modbus.md, and commands of clients except the master."""

            def callback_data(self, data: bytes, addr: tuple | None = None) -> int:
                if any(data[PROTOCOL]):  # pymodbus would keep this and all that follows
                    plug._note("what came is no frame of Modbus TCP")
                    return len(data)
                self.code = data[CODE] if len(data) > CODE else 0
                return super().callback_data(data, addr)

            def server_send(self, pdu: ModbusPDU, addr: tuple | None) -> None:
                if pdu.function_code == NO_CODE:  # pymodbus's answer to an unknown function code
                    pdu.function_code |= self.code
                if pdu.isError() and pdu.exception_code != BUSY:
                    code = pdu.function_code & ~NO_CODE
                    plug._note(f"a request with function code {code} is refused with exception {pdu.exception_code}")
                super().server_send(pdu, addr)

            async def handle_request(self) -> None:
                request = self.last_pdu
                if request is None:
                    return
                peer = self.transport.get_extra_info("peername") if self.transport else None
                self.who = f"the client {peer[0]}:{peer[1]}" if peer else "a client that has gone"
                refusal = plug._refusal(request.function_code, self.who)
                if not refusal:
                    plug._asking = self.who  # valid until the answer: no other task runs before _access
                    await super().handle_request()
                    return
                answer = ExceptionResponse(request.function_code, refusal, device_id=request.dev_id)
                answer.transaction_id = request.transaction_id
                self.server_send(answer, self.last_addr)

            def callback_disconnected(self, exc: Exception | None) -> None:
                super().callback_disconnected(exc)
                plug.has_left(getattr(self, "who", ""))

        class Server(ModbusTcpServer):
            def callback_new_connection(self) -> Client:
                return Client(self, self.trace_packet, self.trace_pdu, self.trace_connect)

        return lambda: Server(device, address=(host, port))

    def _start(self, host: str, port: int, name: str) -> None:
        make = self._maker(host, port, name)
        self._loop, problem, ready = asyncio.new_event_loop(), [], threading.Event()

        async def listen() -> None:
            try:
                self._server = make()
                if not await self._server.listen():
                    raise OSError("the port is taken or not allowed")
            except OSError as error:
                problem.append(error_text(error))
            finally:
                ready.set()

        def serve() -> None:
            asyncio.set_event_loop(self._loop)
            self._loop.run_until_complete(listen())
            if not problem:
                self._loop.run_forever()
            for _ in range(3):  # requests that have come meanwhile become tasks
                self._loop.run_until_complete(asyncio.sleep(0))
            rest = asyncio.all_tasks(self._loop)
            for task in rest:
                task.cancel()
            self._loop.run_until_complete(asyncio.gather(*rest, return_exceptions=True))
            self._loop.close()

        self._thread = threading.Thread(target=serve, name="modbus", daemon=True)
        self._thread.start()
        if not ready.wait(START) or problem:
            raise RigError(f"controller {name}: no server on {host}:{port}: {problem[0] if problem else 'it does not start'}")

    def _note(self, reason: str) -> None:
        with self._bell:
            self._unused[reason] += 1

    def _refusal(self, function: int, who: str) -> int:
        """Return the exception that answers a request of a client, 0 when the request is served."""
        if function not in READING + WRITING:
            return ILLEGAL_FUNCTION
        if function in WRITING and not self.may_command(who):
            with self._bell:
                self._refused.append(who)
                self._bell.notify()
            return BUSY
        return 0

    async def _access(self, function: int, first: int, address: int, count: int, current: list[int], values: list | None) -> None:
        """Serve a request; pymodbus calls it, and ``current`` holds all registers from address ``first`` on."""
        if values is None:
            current[: registers.COMMAND_BASE - first] = self._shown[first : registers.COMMAND_BASE]
            return
        self.commands_now(self._asking)
        place = address - registers.COMMAND_BASE
        whole = list(current[registers.COMMAND_BASE - first : registers.COMMAND_BASE - first + self._own_registers])
        whole[place : place + count] = [int(value) for value in values]
        if place == 0 or whole[registers.HEARTBEAT] != self._heartbeat:
            with self._bell:
                self._written = whole
                self._bell.notify()
        return

    # ---- the seam

    def _send(self, inputs: ControllerInputs) -> None:
        sample = inputs.sample & 0xFFFFFFFF
        raw = [wire.encode(value) & 0xFFFF for wire, value in zip(self._wires, values_of(inputs), strict=True)]
        shown = [sample >> 16, sample & 0xFFFF, inputs.gear_request, int(self.level == "current"), *raw]
        self._shown = shown + [0] * (registers.COMMAND_BASE - len(shown))  # one assignment, so that a reader never sees half of it

    def _listen(self, until: float) -> None:
        while True:
            with self._bell:
                if self._written is None and not self._refused and (rest := until - time.monotonic()) > 0.0:
                    self._bell.wait(rest)
                written, self._written = self._written, None
                refused = self._refused.pop() if self._refused else None
                unused, self._unused = self._unused, Counter()
            for reason in unused.elements():
                self.ignored.add(reason)
            if refused is not None:
                self.refuse(refused)
            if written is not None:
                self._take(written)
            if time.monotonic() >= until:
                return

    def _take(self, written: list[int]) -> None:
        if written[registers.HEARTBEAT] == self._heartbeat:
            return
        self._heartbeat = written[registers.HEARTBEAT]
        first = 1 + len(self._commands)
        self.received_raw(written[1:first], self._commands, written[first:], "in register status")

    def _end(self) -> None:
        async def shut() -> None:
            await self._server.shutdown()
            self._loop.stop()

        if self._thread.is_alive():
            asyncio.run_coroutine_threadsafe(shut(), self._loop)
            self._thread.join(START)
