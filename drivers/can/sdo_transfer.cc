#include "drivers/can/sdo_transfer.h"

#include <algorithm>

namespace vantage::can {
namespace {

constexpr std::size_t kExpedited = 4, kSegment = 7;

std::uint32_t little_endian(const std::uint8_t* bytes) {
  return bytes[0] | std::uint32_t{bytes[1]} << 8 | std::uint32_t{bytes[2]} << 16 | std::uint32_t{bytes[3]} << 24;
}

void put_little_endian(std::uint32_t value, std::uint8_t* bytes) {
  for (int i = 0; i < 4; ++i) bytes[i] = static_cast<std::uint8_t>(value >> (8 * i));
}

}  // namespace

SdoTransfer::SdoTransfer(std::uint8_t node, ObjectAddress object, bool writes)
    : node_(node), object_(object), writes_(writes) {
  request_.id = sdo_to_drive(node);
  request_.size = 8;
  request_.data[1] = static_cast<std::uint8_t>(object.index);
  request_.data[2] = static_cast<std::uint8_t>(object.index >> 8);
  request_.data[3] = object.sub;
}

SdoTransfer SdoTransfer::reading(std::uint8_t node, ObjectAddress object) {
  SdoTransfer transfer(node, object, false);
  transfer.request_.data[0] = 0x40;
  return transfer;
}

SdoTransfer SdoTransfer::writing(std::uint8_t node, ObjectAddress object, std::span<const std::uint8_t> data) {
  SdoTransfer transfer(node, object, true);
  transfer.data_.assign(data.begin(), data.end());
  if (!data.empty() && data.size() <= kExpedited) {
    transfer.request_.data[0] = static_cast<std::uint8_t>(0x23 | (kExpedited - data.size()) << 2);
    std::copy(data.begin(), data.end(), transfer.request_.data.begin() + 4);
    transfer.position_ = data.size();
  } else {
    transfer.request_.data[0] = 0x21;  // in segments, length told
    put_little_endian(static_cast<std::uint32_t>(data.size()), transfer.request_.data.data() + 4);
  }
  return transfer;
}

bool SdoTransfer::names_object(const CanFrame& frame) const {
  return frame.data[1] == static_cast<std::uint8_t>(object_.index) &&
         frame.data[2] == static_cast<std::uint8_t>(object_.index >> 8) && frame.data[3] == object_.sub;
}

SdoTransfer::Step SdoTransfer::fail(SdoAbort code) {
  finished_ = true;
  abort_code_ = static_cast<std::uint32_t>(code);
  request_.data = {0x80, static_cast<std::uint8_t>(object_.index), static_cast<std::uint8_t>(object_.index >> 8),
                   object_.sub};
  put_little_endian(abort_code_, request_.data.data() + 4);
  return Step::kFailed;
}

SdoTransfer::Step SdoTransfer::done() {
  finished_ = true;
  return Step::kDone;
}

SdoTransfer::Step SdoTransfer::answer(const CanFrame& frame) {
  if (finished_ || frame.error || frame.extended || frame.remote || frame.id != sdo_from_drive(node_) ||
      frame.size != 8) {
    return Step::kIgnored;
  }
  const std::uint8_t command = frame.data[0];
  if (command == 0x80) {
    if (!names_object(frame)) return Step::kIgnored;  // the end of an earlier transfer
    finished_ = true;
    abort_code_ = little_endian(frame.data.data() + 4);
    request_.size = 0;
    return Step::kFailed;
  }
  const int specifier = command >> 5;
  if (!initiated_) {
    if (!names_object(frame)) return Step::kIgnored;
    if (!writes_) return specifier == 2 ? take_initiate_read(frame) : fail(SdoAbort::kBadCommand);
    if (specifier != 3) return fail(SdoAbort::kBadCommand);
    initiated_ = true;
    const bool expedited = position_ > 0;
    return expedited ? done() : next_written_segment();  // an empty value still takes one segment
  }
  if (writes_) {
    if (specifier != 1) return fail(SdoAbort::kBadCommand);
    if (((command & 0x10) != 0) != toggle_) return fail(SdoAbort::kToggle);
    position_ += in_flight_;
    toggle_ = !toggle_;
    return position_ == data_.size() ? done() : next_written_segment();
  }
  return specifier == 0 ? take_segment(frame) : fail(SdoAbort::kBadCommand);
}

SdoTransfer::Step SdoTransfer::next_written_segment() {
  in_flight_ = std::min(kSegment, data_.size() - position_);
  const bool last = position_ + in_flight_ == data_.size();
  request_.data.fill(0);
  request_.data[0] = static_cast<std::uint8_t>((toggle_ ? 0x10 : 0) | (kSegment - in_flight_) << 1 | (last ? 1 : 0));
  std::copy_n(data_.begin() + static_cast<std::ptrdiff_t>(position_), in_flight_, request_.data.begin() + 1);
  return Step::kSend;
}

SdoTransfer::Step SdoTransfer::take_initiate_read(const CanFrame& frame) {
  const std::uint8_t command = frame.data[0];
  const bool expedited = (command & 2) != 0, sized = (command & 1) != 0;
  initiated_ = true;
  if (expedited) {
    const std::size_t size = sized ? kExpedited - (command >> 2 & 3) : kExpedited;
    data_.assign(frame.data.begin() + 4, frame.data.begin() + 4 + static_cast<std::ptrdiff_t>(size));
    return done();
  }
  announced_ = sized ? little_endian(frame.data.data() + 4) : 0;
  if (announced_ > kMostBytes) return fail(SdoAbort::kOutOfMemory);
  ask_segment();
  return Step::kSend;
}

void SdoTransfer::ask_segment() {
  request_.data.fill(0);
  request_.data[0] = static_cast<std::uint8_t>(0x60 | (toggle_ ? 0x10 : 0));
}

SdoTransfer::Step SdoTransfer::take_segment(const CanFrame& frame) {
  const std::uint8_t command = frame.data[0];
  if (((command & 0x10) != 0) != toggle_) return fail(SdoAbort::kToggle);
  const std::size_t size = kSegment - (command >> 1 & 7);
  if (data_.size() + size > kMostBytes) return fail(SdoAbort::kOutOfMemory);
  data_.insert(data_.end(), frame.data.begin() + 1, frame.data.begin() + 1 + static_cast<std::ptrdiff_t>(size));
  if ((command & 1) != 0) {
    if (announced_ != 0 && data_.size() != announced_) return fail(SdoAbort::kWrongLength);
    return done();
  }
  toggle_ = !toggle_;
  ask_segment();
  return Step::kSend;
}

}  // namespace vantage::can
