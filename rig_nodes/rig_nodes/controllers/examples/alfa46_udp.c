/* The Alfa46 law of alfa46.c at the other end of a UDP port.
 *
 *   cc -std=gnu99 -O2 -ffp-contract=off -I<this rig's include folder> -o alfa46_udp alfa46_udp.c alfa46.c -lm
 *   ./alfa46_udp                                              (in one terminal; ./alfa46_udp ADDRESS PORT for another rig)
 *   ./rig simulate demo --controller udp:9002                 (in another, before or after)
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
