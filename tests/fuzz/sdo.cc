#include <algorithm>
#include <cstdlib>
#include <memory>

#include "drivers/can/memory_can_bus.h"
#include "drivers/can/sdo_transfer.h"
#include "drivers/sim/drive_rack.h"
#include "lcmtypes/link/clock.h"
#include "targets.h"

namespace vantage::fuzz {
namespace {

constexpr std::uint8_t kNode = 5;

can::CanFrame frame_of(std::uint32_t id, Bytes* input) {
  const Bytes payload = input->first(std::min<std::size_t>(input->size(), 8));
  *input = input->subspan(payload.size());
  return can::make_frame(id, payload);
}

/// A drive that answers anything at all.
void master_side(Bytes input, can::SdoTransfer transfer) {
  while (!input.empty()) {
    const can::SdoTransfer::Step step = transfer.answer(frame_of(can::sdo_from_drive(kNode), &input));
    if (transfer.data().size() > can::SdoTransfer::kMostBytes) std::abort();
    if (step == can::SdoTransfer::Step::kSend && transfer.request().size != 8) std::abort();
    if (step == can::SdoTransfer::Step::kFailed && transfer.abort_code() == 0 && transfer.request().size != 0) {
      std::abort();
    }
  }
}

/// A master that asks anything at all, between PDOs, SYNCs and network commands of its own making.
void drive_side(Bytes input) {
  ManualClock clock;
  can::MemoryCanNetwork network(clock);
  const auto drive_bus = network.attach("drive"), master = network.attach("master");
  sim::DriveRack rack(*drive_bus, clock, {{.node = kNode}});
  network.on_tick([&rack] { rack.step(); });
  rack.start();
  network.advance_to(std::chrono::milliseconds(60));
  constexpr std::uint32_t kIds[] = {0x600 + kNode, 0x600 + kNode, 0x600 + kNode, 0x200 + kNode, 0x080, 0x000, 0x77F};
  while (!input.empty()) {
    const std::uint32_t id = kIds[input[0] % std::size(kIds)];
    input = input.subspan(1);
    master->send(frame_of(id, &input));
    network.advance_to(clock.monotonic() + std::chrono::milliseconds(1));
    can::CanFrame answer;
    while (master->receive(&answer) == can::ReceiveResult::kFrame) {
      if (answer.size > 8) std::abort();
    }
  }
}

}  // namespace

void sdo(Bytes input) {
  if (input.empty()) return;
  const std::uint8_t kind = input[0];
  input = input.subspan(1);
  const std::vector<std::uint8_t> text(kind, 'x');
  switch (kind % 3) {
    case 0:
      return master_side(input, can::SdoTransfer::reading(kNode, {0x1008, 0}));
    case 1:
      return master_side(input, can::SdoTransfer::writing(kNode, {0x2000, 0}, text));
    default:
      return drive_side(input);
  }
}

}  // namespace vantage::fuzz
