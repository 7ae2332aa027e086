/* An external DDS participant: Cyclone DDS in C, with types from its own IDL compiler. Reads objects, pose and map/grid
 * of a running fleet. Prints one line per sample with every field, so that a test can compare it with the written
 * sample. Ends when it has received the requested number of each; exit code 1 if that takes more than SECONDS.
 * usage: cyclone_subscriber DOMAIN SECONDS OBJECTS POSES GRIDS */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "dds/dds.h"
#include "localizer.h"
#include "map.h"
#include "objects.h"

static void print_header(const omnifleet_v1_Header *h) {
  printf(" %" PRId64 " %" PRId64 " %d %" PRIu32, h->acquired_ns, h->published_ns, (int)h->clock, h->sequence_number);
}

static void print_doubles(const double *values, size_t n) {
  for (size_t i = 0; i < n; ++i) printf(" %.17g", values[i]);
}

static void print_point(const omnifleet_v1_Point2 *p) { printf(" %.17g %.17g", p->x, p->y); }

static void print_supports(const omnifleet_v1_Supports *s) {
  printf(" %" PRIu32, s->b_m._length);
  for (uint32_t i = 0; i < s->b_m._length; ++i) printf(" %.9g", (double)s->b_m._buffer[i]);
  printf(" %" PRIu32, s->sigma_m._length);
  for (uint32_t i = 0; i < s->sigma_m._length; ++i) printf(" %.9g", (double)s->sigma_m._buffer[i]);
}

static void print_motion(const omnifleet_v1_Motion *m) {
  printf(" %d %" PRId64, (int)m->valid, m->since_ns);
  printf(" %.17g %.17g %.17g", m->previous_from_current.x, m->previous_from_current.y, m->previous_from_current.theta);
  print_doubles(m->covariance, 9);
  printf(" %.17g %.17g %d", m->left_m, m->right_m, m->wheels_rejected);
}

static void print_floor_motion(const omnifleet_v1_FloorMotion *m) {
  printf(" %d %" PRId64, (int)m->valid, m->since_ns);
  printf(" %.17g %.17g %.17g", m->previous_from_current.x, m->previous_from_current.y, m->previous_from_current.theta);
  print_doubles(m->covariance, 9);
}

static void print_scan(const omnifleet_v1_Scan *s) {
  print_point(&s->origin);
  printf(" %.17g %" PRIu32, s->blind_m, s->range_m._length);
  for (uint32_t i = 0; i < s->range_m._length; ++i) {
    printf(" %.9g %.9g %u %u", (double)s->range_m._buffer[i], (double)s->sigma_m._buffer[i],
           (unsigned)s->label._buffer[i], (unsigned)s->object._buffer[i]);
  }
}

static void print_track(const omnifleet_v1_Track *t) {
  printf(" | %" PRIu32 " %d %.9g %d", t->id, (int)t->kind, (double)t->kind_probability, (int)t->visible);
  print_point(&t->position);
  print_point(&t->velocity);
  print_doubles(t->covariance, 4);
  print_point(&t->contact);
  printf(" %" PRIu32, t->hull._length);
  for (uint32_t i = 0; i < t->hull._length; ++i) print_point(&t->hull._buffer[i]);
  print_supports(&t->support);
  printf(" %.9g %d %.9g %.9g '%s'", (double)t->solidity, (int)t->truncated, (double)t->height_m, (double)t->height_sigma_m,
         t->name);
  printf(" %" PRIu32, t->points._length);
  for (uint32_t i = 0; i < t->points._length; ++i) {
    const omnifleet_v1_ScenePoint *p = &t->points._buffer[i];
    printf(" %.9g %.9g %.9g %.9g", (double)p->position_m[0], (double)p->position_m[1], (double)p->position_m[2],
           (double)p->sigma_m);
  }
}

static void print_objects(const omnifleet_v1_Objects *o) {
  printf("objects %s", o->robot);
  print_header(&o->header);
  printf(" %d %.17g", (int)o->state, o->camera_height_m);
  print_motion(&o->motion);
  print_floor_motion(&o->floor_motion);
  printf(" %" PRIu32, o->tracks._length);
  for (uint32_t i = 0; i < o->tracks._length; ++i) print_track(&o->tracks._buffer[i]);
  print_scan(&o->scan);
  printf("\n");
}

static void print_pose(const omnifleet_v1_Pose *p) {
  printf("pose %s", p->robot);
  print_header(&p->header);
  printf(" %d %.17g %.17g %.17g", (int)p->valid, p->map_from_base.x, p->map_from_base.y, p->map_from_base.theta);
  print_doubles(p->covariance, 9);
  printf(" %" PRIu32, p->sightings._length);
  for (uint32_t i = 0; i < p->sightings._length; ++i) {
    printf(" %" PRIu32 " %s", p->sightings._buffer[i].track_id, p->sightings._buffer[i].robot);
  }
  printf(" %" PRIu32 " %" PRIu32, p->term, p->published._length);
  for (uint32_t i = 0; i < p->published._length; ++i)
    printf(" %s %" PRId64, p->published._buffer[i].robot, p->published._buffer[i].last_ns);
  printf("\n");
}

static void print_grid(const omnifleet_v1_Grid *g) {
  printf("grid %s", g->map_name);
  print_header(&g->header);
  printf(" %" PRIu32 " %.17g", g->term, g->resolution_m);
  print_point(&g->origin);
  uint64_t hash = 1469598103934665603u; /* FNV-1a over the cells */
  for (uint32_t i = 0; i < g->cells._length; ++i) hash = (hash ^ g->cells._buffer[i]) * 1099511628211u;
  printf(" %" PRIu32 " %" PRIu32 " %" PRIu32 " %" PRIu64 "\n", g->width, g->height, g->cells._length, hash);
}

typedef void (*print_sample)(const void *);

static dds_entity_t make_reader(dds_entity_t participant, const dds_topic_descriptor_t *type, const char *name,
                                int transient_local) {
  dds_qos_t *qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 64);
  if (transient_local) dds_qset_durability(qos, DDS_DURABILITY_TRANSIENT_LOCAL);
  const dds_entity_t topic = dds_create_topic(participant, type, name, NULL, NULL);
  const dds_entity_t reader = dds_create_reader(participant, topic, qos, NULL);
  dds_delete_qos(qos);
  if (reader < 0) {
    fprintf(stderr, "%s: %s\n", name, dds_strretcode(-reader));
    exit(1);
  }
  return reader;
}

static int drain(dds_entity_t reader, print_sample print) {
  void *samples[64] = {NULL};
  dds_sample_info_t infos[64];
  const int n = dds_take(reader, samples, infos, 64, 64);
  int printed = 0;
  for (int i = 0; i < n; ++i) {
    if (!infos[i].valid_data) continue;
    print(samples[i]);
    ++printed;
  }
  if (n > 0) dds_return_loan(reader, samples, n);
  fflush(stdout);
  return printed;
}

int main(int argc, char **argv) {
  if (argc != 6) return 2;
  const dds_entity_t participant = dds_create_participant((dds_domainid_t)atoi(argv[1]), NULL, NULL);
  if (participant < 0) return 1;
  const dds_entity_t objects = make_reader(participant, &omnifleet_v1_Objects_desc, "omnifleet/objects", 0);
  const dds_entity_t poses = make_reader(participant, &omnifleet_v1_Pose_desc, "omnifleet/pose", 0);
  const dds_entity_t grids = make_reader(participant, &omnifleet_v1_Grid_desc, "omnifleet/map/grid", 1);
  const dds_entity_t readers[3] = {objects, poses, grids};
  const print_sample printers[3] = {(print_sample)print_objects, (print_sample)print_pose, (print_sample)print_grid};
  const dds_entity_t set = dds_create_waitset(participant);
  for (int i = 0; i < 3; ++i) {
    dds_set_status_mask(readers[i], DDS_DATA_AVAILABLE_STATUS);
    dds_waitset_attach(set, readers[i], (dds_attach_t)i);
  }
  int wanted[3];
  for (int i = 0; i < 3; ++i) wanted[i] = atoi(argv[3 + i]);
  const dds_time_t end = dds_time() + DDS_SECS(atoi(argv[2]));
  while ((wanted[0] > 0 || wanted[1] > 0 || wanted[2] > 0) && dds_time() < end) {
    dds_attach_t ready[3];
    const int n = dds_waitset_wait_until(set, ready, 3, end);
    for (int i = 0; i < n; ++i) wanted[ready[i]] -= drain(readers[ready[i]], printers[ready[i]]);
  }
  dds_delete(participant);
  return wanted[0] > 0 || wanted[1] > 0 || wanted[2] > 0;
}
