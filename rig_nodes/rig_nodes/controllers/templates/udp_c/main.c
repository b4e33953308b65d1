/* Brings the controller of my_controller.c to the rig over UDP, until Ctrl-C.
 * ./my_controller [ADDRESS [PORT]], e.g. ./my_controller 127.0.0.1 9002
 */
#include "rig_udp.h"

static void on_signal(int number) {
  (void)number;
  rig_udp_stop = 1;
}

int main(int count, char **arguments) {
  struct sigaction action;
  memset(&action, 0, sizeof action);
  action.sa_handler = on_signal;
  sigaction(SIGINT, &action, NULL);
  sigaction(SIGTERM, &action, NULL);
  return rig_udp_serve(count > 1 ? arguments[1] : "127.0.0.1", count > 2 ? atoi(arguments[2]) : RIG_UDP_PORT, 0);
}
