/// Frames and checkpoints of a run.
#include <fmt/format.h>
#include <omp.h>
#include <unistd.h>

#include "run/run.hpp"
#include "version.hpp"

namespace phyxel::app {

std::string Run::with_last_good_state(const char* error, Progress& progress) {
  progress.finish();
  try {
    write_state();
    writer_.finish();
  } catch (const Error& writing) {
    // An error of this rank alone must end all ranks.
    if (ranks().size() > 1 && !dynamic_cast<const AgreedError*>(&writing)) throw;
    return fmt::format("{}; the last good state could not be written: {}", error, writing.what());
  }
  return fmt::format("{}; the last good state, at t = {:g} s, is {}", error, good_->state.time,
                     checkpoint_.string());
}

std::shared_ptr<const GoodState> Run::good_state(const Diagnostics& now) const {
  return std::make_shared<const GoodState>(GoodState{solver_.state(), now, watched_});
}

bool Run::core_is_left() const {
  if (device_.gpu) return true;
  const int threads = backend_->threads();  // equal on all ranks
  return threads < omp_get_num_procs() &&
         threads * ranks().host_size() < sysconf(_SC_NPROCESSORS_ONLN);
}

void Run::hand_over(std::shared_ptr<const Moment> moment, FileWriter::Job job) {
  writer_.submit(std::move(moment), std::move(job));
  // The first rank decides, since it writes.
  if (ranks().broadcast(std::vector<char>{core_is_left()}).front() == 0) writer_.finish();
}

std::shared_ptr<Moment> Run::moment_of(const std::shared_ptr<const GoodState>& good) {
  auto moment = std::make_shared<Moment>();
  moment->state = std::shared_ptr<const State>(good, &good->state);
  moment->frame.state = &good->state;
  moment->frame.diagnostics = good->diagnostics;
  return moment;
}

void Run::write_frame(const std::shared_ptr<const GoodState>& good) {
  const Phase phase("frame");
  const auto moment = moment_of(good);
  Frame& frame = moment->frame;
  if (scene_.output.surface && model().global_surfel_count() > 0) {
    backend_->advect_surfels(moment->surfels);
    frame.surfels = &moment->surfels;
    moment->optional.push_back(Quantity::surfel_position);
    moment->triangles = uncut_triangles(model(), shared_.triangles(), good->state.broken);
    if (moment->triangles) frame.triangles = &*moment->triangles;
  }
  const std::vector<Quantity>& found = fields_.quantities();
  moment->optional.insert(moment->optional.end(), found.begin(), found.end());
  frame.fields = fields_.find(*backend_, good->state, frame.surfels, recovery_.get());
  hand_over(moment,
            [this, diagnostics = good->diagnostics, readings = readings_](ChunkedSource& values) {
              const Phase writing("writing a frame");
              recorder_->write(diagnostics, values, readings);
            });
}

void Run::write_state() {
  hand_over(moment_of(good_), [this, good = good_](ChunkedSource& values) {
    const Phase writing("writing a checkpoint");
    CheckpointInfo info;
    info.program = program_version();
    info.precision = scene_.solver.precision;
    info.method = scene_.solver.method;
    info.scene_text = scene_.text;
    info.model_digest = shared_.digest();
    info.parameters = scene_parameters(scene_);
    info.total_energy = good->diagnostics.total_energy();
    info.watched = good->watched;
    info.frames_written = recorder_->frames_written();
    recorder_->sync();  // the checkpoint counts the frames
    checkpoint_ =
        write_checkpoint(recorder_->directory(), good->state, info, model().global_count(), values);
  });
}

}  // namespace phyxel::app
