/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* Brings the controller that it is linked with (rig_controller.h) to the rig over UDP, until Ctrl-C.
 *
 *   ./my_controller                                             (in one terminal; with ADDRESS PORT for another rig)
 *   ./rig simulate demo --controller udp:9002 --level current   (in another, before or after)
 *
 * --level is what the controller's commands are. Compile this file with your controller, -I where rig_udp.h is:
 * cc -std=gnu99 -O2 -ffp-contract=off; ./rig controller new udp-c prints the whole command.
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
