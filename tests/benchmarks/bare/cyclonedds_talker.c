// std_msgs/String on /chatter, on Cyclone DDS alone: adit_bench_cyclonedds_talker SECONDS DOMAIN HERTZ.
#include <dds/dds.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>

#include "chatter.h"

static volatile sig_atomic_t stop = 0;
static void on_signal(int number) {
  (void)number;
  stop = 1;
}

int main(int argc, char** argv) {
  signal(SIGINT, on_signal);
  signal(SIGTERM, on_signal);
  const double seconds = argc > 1 ? atof(argv[1]) : 10.0;
  const int domain = argc > 2 ? atoi(argv[2]) : 0;
  const double hertz = argc > 3 ? atof(argv[3]) : 10.0;
  char xml[800];
  snprintf(xml, sizeof xml,
           "<Domain><General><Interfaces><NetworkInterface address=\"127.0.0.1\"/></Interfaces>"
           "<AllowMulticast>false</AllowMulticast></General><Discovery><ExternalDomainId>%d</ExternalDomainId>"
           "<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>119</MaxAutoParticipantIndex>"
           "<Peers><Peer address=\"127.0.0.1\"/></Peers></Discovery></Domain>",
           domain);
  if (dds_create_domain(1, xml) < 0) return 1;
  const dds_entity_t participant = dds_create_participant(1, NULL, NULL);
  const dds_entity_t topic = dds_create_topic(participant, &std_msgs_msg_dds__String__desc, "rt/chatter", NULL, NULL);
  dds_qos_t* const qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_MSECS(100));
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 10);
  const dds_entity_t writer = dds_create_writer(participant, topic, qos, NULL);
  dds_delete_qos(qos);
  if (writer < 0) return 1;
  char text[64];
  std_msgs_msg_dds__String_ message = {text};
  for (int i = 0; i < (int)(hertz * seconds) && !stop; ++i) {
    snprintf(text, sizeof text, "Hello World: %d", i);
    dds_write(writer, &message);
    dds_sleepfor((dds_duration_t)(1e9 / hertz));
  }
  dds_delete(DDS_CYCLONEDDS_HANDLE);
  return 0;
}
