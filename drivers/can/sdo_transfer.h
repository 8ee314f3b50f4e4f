#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "drivers/can/can_frame.h"
#include "drivers/can/object_table.h"
#include "drivers/can/sdo_abort.h"

namespace vantage::can {

/// Identifiers of CiA 301 that carry service data objects.
constexpr std::uint32_t sdo_to_drive(std::uint8_t node) { return 0x600U + node; }
constexpr std::uint32_t sdo_from_drive(std::uint8_t node) { return 0x580U + node; }

/// One reading or writing of an object, seen from the master (CiA 301, 7.2.4.3): expedited up to four bytes, in
/// segments of seven above. Holds no bus and no clock.
///
///     SdoTransfer transfer = SdoTransfer::reading(node, objects::kStatusword);
///     bus.send(transfer.request());
///     ... for every frame of sdo_from_drive(node):
///     if (transfer.answer(frame) == SdoTransfer::Step::kSend) bus.send(transfer.request());
class SdoTransfer {
 public:
  enum class Step {
    kIgnored,  ///< not an answer to this transfer
    kSend,     ///< `request` has the next frame to send
    kDone,
    kFailed  ///< `abort_code` says why; when `request` is not empty it tells the drive
  };

  /// A drive that announces more than this is refused: no object of a drive is longer.
  static constexpr std::size_t kMostBytes = 1 << 16;

  static SdoTransfer reading(std::uint8_t node, ObjectAddress object);
  static SdoTransfer writing(std::uint8_t node, ObjectAddress object, std::span<const std::uint8_t> data);

  const CanFrame& request() const { return request_; }
  Step answer(const CanFrame& frame);

  /// What was read; complete once the transfer is done.
  const std::vector<std::uint8_t>& data() const { return data_; }
  std::uint32_t abort_code() const { return abort_code_; }
  ObjectAddress object() const { return object_; }

 private:
  SdoTransfer(std::uint8_t node, ObjectAddress object, bool writes);
  Step fail(SdoAbort code);
  Step done();
  Step next_written_segment();
  Step take_initiate_read(const CanFrame& frame);
  Step take_segment(const CanFrame& frame);
  void ask_segment();
  bool names_object(const CanFrame& frame) const;

  std::uint8_t node_;
  ObjectAddress object_;
  bool writes_;
  bool initiated_ = false, finished_ = false;
  bool toggle_ = false;       // of the segment under way
  std::size_t position_ = 0;  // bytes written so far
  std::size_t in_flight_ = 0;
  std::size_t announced_ = 0;  // bytes the drive will send; 0: it does not say
  std::vector<std::uint8_t> data_;
  std::uint32_t abort_code_ = 0;
  CanFrame request_;
};

}  // namespace vantage::can
