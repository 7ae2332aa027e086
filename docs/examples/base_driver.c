/* SPDX-License-Identifier: Apache-2.0
 * Driver of a robot base for omnifleet, with Cyclone DDS: takes wheels/command, writes wheels/odometry
 * at 50 Hz. Replace `struct base` and its two functions by your base. As it is, it simulates a base.
 * usage: base_driver ROBOT [DOMAIN]              (docs/guide/from_the_arena_to_your_robots.md) */
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "dds/dds.h"
#include "wheels.h" /* idlc -I idl idl/wheels.idl */

/* ---- Your base begins here. Speeds of left and right wheel on the floor, m/s, forward is positive. ---- */
struct base { /* yours: file descriptor of the serial port, last tick counts, time of the last call */
  double command_mps[2], speed_mps[2];
};

static void base_drive(struct base* b, double left_mps, double right_mps) { /* yours: send a motor command */
  b->command_mps[0] = left_mps;
  b->command_mps[1] = right_mps;
}

static void base_measure(struct base* b, double speed_mps[2]) { /* yours: mean speeds since the last call */
  for (int i = 0; i < 2; ++i) { /* this base changes its speeds by at most 1 m/s², 0.02 m/s per call */
    const double change_mps = b->command_mps[i] - b->speed_mps[i];
    b->speed_mps[i] += change_mps > 0.02 ? 0.02 : change_mps < -0.02 ? -0.02 : change_mps;
    speed_mps[i] = b->speed_mps[i];
  }
}
/* ---- Your base ends here. ---- */

static volatile sig_atomic_t stop;
static void on_signal(int number) {
  stop = number;
}

static int64_t now_ns(clockid_t clock) {
  struct timespec t;
  clock_gettime(clock, &t);
  return t.tv_sec * 1000000000LL + t.tv_nsec;
}

int main(int argc, char** argv) {
  if (argc < 2) return fprintf(stderr, "usage: base_driver ROBOT [DOMAIN]\n"), 2;
  const char *robot = argv[1], *written[2] = {"", robot}; /* all robots' readers, this robot's readers */
  const dds_entity_t dds = dds_create_participant(argc > 2 ? (dds_domainid_t)atoi(argv[2]) : 0, NULL, NULL);
  const dds_entity_t out =
      dds_create_topic(dds, &omnifleet_v1_WheelOdometry_desc, "omnifleet/wheels/odometry", NULL, NULL);
  const dds_entity_t in =
      dds_create_topic(dds, &omnifleet_v1_WheelCommand_desc, "omnifleet/wheels/command", NULL, NULL);
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 16);
  dds_qset_partition(qos, 2, written);
  const dds_entity_t writer = dds_create_writer(dds, out, qos, NULL);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1); /* only the latest command counts */
  dds_qset_partition1(qos, robot);                 /* only commands of this robot */
  const dds_entity_t reader = dds_create_reader(dds, in, qos, NULL);
  if (writer < 0 || reader < 0)
    return fprintf(stderr, "no DDS: %s\n", dds_strretcode(writer < 0 ? writer : reader)), 1;
  signal(SIGINT, on_signal);
  signal(SIGTERM, on_signal);

  struct base base = {{0, 0}, {0, 0}};
  omnifleet_v1_WheelOdometry odometry = {.header.clock = omnifleet_v1_CLOCK_SYSTEM};
  snprintf(odometry.robot, sizeof odometry.robot, "%s", robot);
  const int64_t period_ns = 20000000, command_holds_ns = 1000000000;
  int64_t tick_ns = now_ns(CLOCK_MONOTONIC), measured_ns = now_ns(CLOCK_REALTIME), commanded_ns = 0;
  while (!stop) {
    tick_ns += period_ns;
    const struct timespec tick = {tick_ns / 1000000000, tick_ns % 1000000000};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &tick, NULL);
    void* sample[1] = {NULL};
    dds_sample_info_t info[1];
    if (dds_take(reader, sample, info, 1, 1) > 0) {
      const omnifleet_v1_WheelCommand* command = sample[0];
      if (info[0].valid_data)
        base_drive(&base, command->v_left_mps, command->v_right_mps), commanded_ns = tick_ns;
      dds_return_loan(reader, sample, 1);
    }
    if (commanded_ns > 0 && tick_ns - commanded_ns > command_holds_ns) { /* formation is gone: stand, once */
      base_drive(&base, 0, 0);
      commanded_ns = 0;
    }

    double speed_mps[2];
    base_measure(&base, speed_mps);
    odometry.header.acquired_ns = measured_ns; /* when the mean begins: speeds hold from stamp to stamp */
    measured_ns = now_ns(CLOCK_REALTIME);      /* the clock of the camera's frames, ns */
    odometry.header.published_ns = measured_ns;
    odometry.v_left_mps = speed_mps[0];
    odometry.v_right_mps = speed_mps[1];
    dds_write(writer, &odometry);
    ++odometry.header.sequence_number;
  }
  base_drive(&base, 0, 0);
  dds_delete(dds);
  return 0;
}
