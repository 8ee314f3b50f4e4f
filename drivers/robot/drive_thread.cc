#include "drivers/robot/drive_thread.h"

#include <algorithm>
#include <ctime>

namespace vantage {
namespace {

using std::chrono::nanoseconds;

nanoseconds now_of(clockid_t clock) {
  timespec time{};
  ::clock_gettime(clock, &time);
  return std::chrono::seconds(time.tv_sec) + nanoseconds(time.tv_nsec);
}

std::size_t cycles_in(nanoseconds time, const DrivesRig& rig) { return static_cast<std::size_t>(time / rig.cycle); }

}  // namespace

DriveThread::DriveThread(can::CanBus& bus, const Clock& clock, const DrivesRig& rig, const DriveThreadOptions& options)
    : drives_(bus, clock, rig),
      recorder_(cycles_in(options.recorded, rig), std::max<std::size_t>(1, cycles_in(options.recorded_after, rig))),
      priority_(options.priority) {
  drives_.on_cycle([this](const RobotState& state) {
    recorder_.record(state);
    state_.write(state);
  });
  thread_ = std::thread([this] { run(); });
  std::unique_lock lock(mutex_);
  answered_.wait(lock, [this] { return ready_; });  // realtime() is known
}

DriveThread::~DriveThread() {
  request(DriveRequest::kDisable);
  ask(Question::kStop);
  thread_.join();
}

void DriveThread::run() {
  realtime_ = enter_realtime(priority_);
  figures_since_ = now_of(CLOCK_MONOTONIC);
  cpu_since_ = now_of(CLOCK_THREAD_CPUTIME_ID);
  {
    const std::lock_guard lock(mutex_);
    ready_ = true;
  }
  answered_.notify_all();
  RobotCommand command;
  while (true) {
    const Question question = question_.load(std::memory_order_acquire);
    if (question != Question::kNone) {
      answer();
      if (question == Question::kStop) return;
    }
    command_.read(&command);
    drives_.cycle(command);
  }
}

void DriveThread::answer() {
  const Question question = question_.load(std::memory_order_acquire);
  std::string text;
  DriveFigures figures;
  const nanoseconds now = now_of(CLOCK_MONOTONIC), cpu = now_of(CLOCK_THREAD_CPUTIME_ID);
  switch (question) {
    case Question::kRequest:
      text = carry_out(request_);
      state_.write(drives_.state());
      break;
    case Question::kFaultText:
      text = drives_.fault_text();
      break;
    case Question::kFigures:
      figures.punctuality = drives_.punctuality();
      figures.cpu_share = static_cast<double>((cpu - cpu_since_).count()) /
                          static_cast<double>(std::max(now - figures_since_, nanoseconds(1)).count());
      break;
    case Question::kClearFigures:
      drives_.clear_punctuality();
      figures_since_ = now;
      cpu_since_ = cpu;
      break;
    case Question::kNone:
    case Question::kStop:
      break;
  }
  {
    const std::lock_guard lock(mutex_);
    answer_ = text;
    figures_ = figures;
    question_.store(Question::kNone, std::memory_order_release);
  }
  answered_.notify_all();
}

std::string DriveThread::carry_out(DriveRequest request) {
  switch (request) {
    case DriveRequest::kSetUp:
      return drives_.set_up();
    case DriveRequest::kHome:
      return drives_.home();
    case DriveRequest::kEnable:
      return drives_.enable();
    case DriveRequest::kDisable:
      return drives_.disable();
    case DriveRequest::kRecover:
      return drives_.recover();
  }
  return {};
}

std::string DriveThread::ask(Question question) {
  std::unique_lock lock(mutex_);
  question_.store(question, std::memory_order_release);
  answered_.wait(lock, [this] { return question_.load(std::memory_order_acquire) == Question::kNone; });
  return answer_;
}

std::string DriveThread::request(DriveRequest request) {
  const std::lock_guard one(asking_);
  request_ = request;  // the loop reads it only once the question is set
  return ask(Question::kRequest);
}

RobotState DriveThread::state() {
  RobotState state;
  state_.read(&state);
  return state;
}

std::string DriveThread::fault_text() {
  const std::lock_guard one(asking_);
  return ask(Question::kFaultText);
}

DriveFigures DriveThread::figures() {
  const std::lock_guard one(asking_);
  ask(Question::kFigures);
  const std::lock_guard lock(mutex_);
  return figures_;
}

void DriveThread::clear_figures() {
  const std::lock_guard one(asking_);
  ask(Question::kClearFigures);
}

}  // namespace vantage
