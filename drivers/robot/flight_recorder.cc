#include "drivers/robot/flight_recorder.h"

#include <algorithm>

#include "calib/files/atomic_file.h"

namespace vantage {

FlightRecorder::FlightRecorder(std::size_t cycles, std::size_t after) : ring_(cycles + after), after_(after) {}

void FlightRecorder::record(const RobotState& state) {
  if (complete_.load(std::memory_order_acquire)) return;
  ring_[next_] = state;
  next_ = (next_ + 1) % ring_.size();
  count_ = std::min(count_ + 1, ring_.size());
  const bool fault = state.phase == DrivesPhase::kFault;
  if (fault && !in_fault_) left_ = after_;
  in_fault_ = fault;
  if (left_ > 0 && --left_ == 0) complete_.store(true, std::memory_order_release);
}

void FlightRecorder::resume() {
  next_ = count_ = left_ = 0;
  in_fault_ = false;
  complete_.store(false, std::memory_order_release);
}

void FlightRecorder::write(const std::filesystem::path& path) const {
  AtomicFile file(path);
  std::ostream& out = file.stream();
  out.precision(9);
  out << "time_s,cycle,phase,x_m,y_m,heading_rad";
  const std::size_t first = (next_ + ring_.size() - count_) % ring_.size();
  const std::size_t axes = count_ == 0 ? 0 : ring_[first].axes;
  for (std::size_t i = 1; i <= axes; ++i) {
    out << ",position_" << i << "_rad,speed_" << i << "_rad_s,following_error_" << i << "_rad,drive_" << i;
  }
  out << '\n';
  for (std::size_t k = 0; k < count_; ++k) {
    const RobotState& state = ring_[(first + k) % ring_.size()];
    out << std::chrono::duration<double>(state.time).count() << ',' << state.cycle << ','
        << static_cast<int>(state.phase) << ',' << state.base.x_m << ',' << state.base.y_m << ','
        << state.base.heading_rad;
    for (std::size_t i = 0; i < axes; ++i) {
      const AxisState& axis = state.axis[i];
      out << ',' << axis.position_rad << ',' << axis.speed_rad_s << ',' << axis.following_error_rad << ','
          << to_text(axis.drive);
    }
    out << '\n';
  }
  file.commit();
}

}  // namespace vantage
