// Copyright 2026 Virtual rig maintainers
// SPDX-License-Identifier: Apache-2.0

// Release check of the Modbus plug with another client library: it runs the law of the templates with npm's modbus-serial.
//
//     npm install modbus-serial && NODE_PATH=node_modules node tests/release/modbus_serial.js 5020
//
// It waits for a rig, answers it until the rig ends, and then ends itself. See README.md beside it.

const ModbusRTU = require("modbus-serial");

const FILL = 0.3, PLATEAU = 220, SLOPE = 1200, HELD = 740; // s, mA, mA/s, mA
const OVERLAP = 0.25, RELEASE = 130; // s during which both clutches are on; mA of the old one while the new one takes the torque
const pause = (ms) => new Promise((done) => setTimeout(done, ms));

let gear = 0, old = 0, since = -10;

function step(now, request) {
  if (request !== gear) [old, gear, since] = [gear, request, now];
  const elapsed = now - since, command = [0, 0, 0];
  if (old && elapsed < OVERLAP + 0.2) command[old - 1] = elapsed < OVERLAP ? HELD : RELEASE;
  if (gear) command[gear - 1] = Math.min(PLATEAU + SLOPE * Math.max(0, elapsed - FILL), HELD);
  return [...command.map((ma) => Math.round(ma / 0.02)), gear, Number(elapsed < 1.5), 0, 0];
}

async function connected(port) {
  for (;;) {
    const client = new ModbusRTU();
    try {
      await client.connectTCP("127.0.0.1", { port });
      client.setTimeout(500);
      return client;
    } catch {
      await pause(100); // the rig is not listening yet
    }
  }
}

async function main(port) {
  const client = await connected(port);
  let answers = 0;
  try {
    for (;; await pause(1)) {
      const [high, low, request] = (await client.readInputRegisters(0, 11)).data;
      await client.writeRegisters(32, [(answers % 65535) + 1, ...step(1e-3 * (high * 65536 + low), request)]);
      answers += 1;
    }
  } catch (error) {
    console.log(`modbus-serial: ${answers} answers, until the rig went (${error.message})`);
  }
  client.close(() => process.exit(answers > 1000 ? 0 : 1));
}

main(Number(process.argv[2] || 5020));
