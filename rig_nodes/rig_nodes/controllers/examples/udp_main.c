/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* A program that connects the controller with which it is linked (rig_controller.h) to the rig over UDP, until Ctrl-C.
 *
 *   ./my_controller                                             (in one terminal; the arguments ADDRESS PORT choose another rig)
 *   ./rig simulate demo --controller udp:9002 --level current   (in another terminal, started before or after)
 *
 * --level states whether the controller commands currents or duties. Compile this file together with your controller, with
 * cc -std=gnu99 -O2 -ffp-contract=off and -I for the folder of rig_udp.h; ./rig controller new udp-c prints the command.
 */
#include "rig_udp.h"

static void on_signal(int number) {
  (void)number;
  rig_udp_stop = 1;
}

int main(int count, char **arguments) {
  const char *host = count > 1 ? arguments[1] : "127.0.0.1";
  const int port = count > 2 ? atoi(arguments[2]) : RIG_UDP_PORT;
  struct sigaction action;
  memset(&action, 0, sizeof action);
  action.sa_handler = on_signal;
  sigaction(SIGINT, &action, NULL);
  sigaction(SIGTERM, &action, NULL);
  return rig_udp_serve(host, port, 0);
}
