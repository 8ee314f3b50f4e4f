#include "drivers/sim/drive_dictionary.h"

#include <algorithm>

#include "drivers/can/sdo_transfer.h"

namespace vantage::sim {
namespace {

using can::CanFrame;
using can::SdoAbort;

constexpr std::size_t kLongestText = 256;

std::int64_t number_of(std::span<const std::uint8_t> bytes, bool is_signed) {
  std::int64_t value = 0;
  for (std::size_t i = bytes.size(); i-- > 0;) value = value << 8 | bytes[i];
  if (is_signed && !bytes.empty() && (bytes.back() & 0x80) != 0) value -= std::int64_t{1} << (8 * bytes.size());
  return value;
}

}  // namespace

void DriveDictionary::define(Address address, const can::ObjectEntry& entry, std::int64_t value) {
  numbers_[address] = {entry, value};
}

void DriveDictionary::define_text(Address address, const std::string& name, const std::string& text, bool writable) {
  can::ObjectEntry entry;
  entry.name = name;
  entry.type = can::DataType::kVisibleString;
  entry.writable = writable;
  texts_[address] = {entry, text};
}

void DriveDictionary::on_write(Judge judge, Listener listener) {
  judge_ = std::move(judge);
  listener_ = std::move(listener);
}

int DriveDictionary::size_of(Address address) const {
  const auto found = numbers_.find(address);
  return found == numbers_.end() ? 0 : can::size_of(found->second.entry.type);
}

std::int64_t DriveDictionary::get(Address address) const { return numbers_.at(address).value; }

void DriveDictionary::set(Address address, std::int64_t value) { numbers_.at(address).value = value; }

std::string DriveDictionary::text(Address address) const { return texts_.at(address).value; }

can::ObjectMap DriveDictionary::entries() const {
  can::ObjectMap map;
  for (const auto& [address, number] : numbers_) map[address] = number.entry;
  for (const auto& [address, text] : texts_) map[address] = text.entry;
  return map;
}

bool DriveDictionary::knows_index(std::uint16_t index) const {
  const auto number = numbers_.lower_bound({index, 0});
  const auto text = texts_.lower_bound({index, 0});
  return (number != numbers_.end() && number->first.index == index) ||
         (text != texts_.end() && text->first.index == index);
}

std::optional<SdoAbort> DriveDictionary::write(Address address, std::int64_t value) {
  const auto found = numbers_.find(address);
  if (found == numbers_.end()) return knows_index(address.index) ? SdoAbort::kNoSubindex : SdoAbort::kNoObject;
  Number& number = found->second;
  if (!number.entry.writable) return SdoAbort::kReadOnly;
  if (number.entry.low_limit && value < *number.entry.low_limit) return SdoAbort::kTooLow;
  if (number.entry.high_limit && value > *number.entry.high_limit) return SdoAbort::kTooHigh;
  if (judge_) {
    if (const auto refused = judge_(address, value)) return refused;
  }
  number.value = value;
  if (listener_) listener_(address, value);
  return {};
}

std::optional<SdoAbort> DriveDictionary::fetch(Address address, std::vector<std::uint8_t>* data) const {
  if (const auto number = numbers_.find(address); number != numbers_.end()) {
    for (int i = 0; i < can::size_of(number->second.entry.type); ++i) {
      data->push_back(static_cast<std::uint8_t>(number->second.value >> (8 * i)));
    }
    return {};
  }
  if (const auto text = texts_.find(address); text != texts_.end()) {
    data->assign(text->second.value.begin(), text->second.value.end());
    return {};
  }
  return knows_index(address.index) ? SdoAbort::kNoSubindex : SdoAbort::kNoObject;
}

std::optional<SdoAbort> DriveDictionary::store(Address address, std::span<const std::uint8_t> data) {
  if (const auto text = texts_.find(address); text != texts_.end()) {
    if (!text->second.entry.writable) return SdoAbort::kReadOnly;
    if (data.size() > kLongestText) return SdoAbort::kTooLong;
    text->second.value.assign(data.begin(), data.end());
    return {};
  }
  const auto number = numbers_.find(address);
  if (number == numbers_.end()) return knows_index(address.index) ? SdoAbort::kNoSubindex : SdoAbort::kNoObject;
  const auto size = static_cast<std::size_t>(can::size_of(number->second.entry.type));
  if (data.size() > size) return SdoAbort::kTooLong;
  if (data.size() < size) return SdoAbort::kTooShort;
  return write(address, number_of(data, can::is_signed(number->second.entry.type)));
}

void DriveDictionary::serve(const CanFrame& frame, std::uint8_t node, can::CanBus& bus) {
  if (frame.size != 8) return;
  const Address address{static_cast<std::uint16_t>(frame.data[1] | frame.data[2] << 8), frame.data[3]};
  CanFrame answer =
      can::make_frame(can::sdo_from_drive(node), {0, frame.data[1], frame.data[2], frame.data[3], 0, 0, 0, 0});
  std::optional<SdoAbort> refused;
  switch (frame.data[0] >> 5) {
    case 0:
      refused = download_segment(frame, &answer);
      break;
    case 1:
      refused = begin_download(frame, address, &answer);
      break;
    case 2:
      refused = begin_upload(address, &answer);
      break;
    case 3:
      refused = upload_segment(frame, &answer);
      break;
    case 4:
      segments_.reset();  // the master gives up
      return;
    default:
      refused = SdoAbort::kBadCommand;
  }
  if (refused) {
    const auto code = static_cast<std::uint32_t>(*refused);
    const Address culprit = segments_ ? segments_->address : address;
    answer =
        can::make_frame(can::sdo_from_drive(node),
                        {0x80, static_cast<std::uint8_t>(culprit.index), static_cast<std::uint8_t>(culprit.index >> 8),
                         culprit.sub, static_cast<std::uint8_t>(code), static_cast<std::uint8_t>(code >> 8),
                         static_cast<std::uint8_t>(code >> 16), static_cast<std::uint8_t>(code >> 24)});
    segments_.reset();
  }
  bus.send(answer);
}

std::optional<SdoAbort> DriveDictionary::begin_upload(Address address, CanFrame* answer) {
  segments_.reset();
  std::vector<std::uint8_t> data;
  if (const auto refused = fetch(address, &data)) return refused;
  if (!data.empty() && data.size() <= 4) {
    answer->data[0] = static_cast<std::uint8_t>(0x43 | (4 - data.size()) << 2);
    std::copy(data.begin(), data.end(), answer->data.begin() + 4);
    return {};
  }
  answer->data[0] = 0x41;
  for (std::size_t i = 0; i < 4; ++i) answer->data[4 + i] = static_cast<std::uint8_t>(data.size() >> (8 * i));
  segments_ = Segments{true, address, std::move(data), 0, 0, false};
  return {};
}

std::optional<SdoAbort> DriveDictionary::upload_segment(const CanFrame& frame, CanFrame* answer) {
  if (!segments_ || !segments_->upload) return SdoAbort::kBadCommand;
  if (((frame.data[0] & 0x10) != 0) != segments_->toggle) return SdoAbort::kToggle;
  const std::size_t size = std::min<std::size_t>(7, segments_->data.size() - segments_->position);
  const bool last = segments_->position + size == segments_->data.size();
  answer->data.fill(0);
  answer->data[0] = static_cast<std::uint8_t>((segments_->toggle ? 0x10 : 0) | (7 - size) << 1 | (last ? 1 : 0));
  std::copy_n(segments_->data.begin() + static_cast<std::ptrdiff_t>(segments_->position), size,
              answer->data.begin() + 1);
  segments_->position += size;
  segments_->toggle = !segments_->toggle;
  if (last) segments_.reset();
  return {};
}

std::optional<SdoAbort> DriveDictionary::begin_download(const CanFrame& frame, Address address, CanFrame* answer) {
  segments_.reset();
  const bool expedited = (frame.data[0] & 2) != 0, sized = (frame.data[0] & 1) != 0;
  answer->data[0] = 0x60;
  if (expedited) {
    const std::size_t size = sized ? 4U - (frame.data[0] >> 2 & 3U) : static_cast<std::size_t>(size_of(address));
    return store(address, std::span(frame.data).subspan(4, std::min<std::size_t>(size, 4)));
  }
  const auto announced = static_cast<std::size_t>(number_of(std::span(frame.data).subspan(4), false));
  if (announced > kLongestText) return SdoAbort::kTooLong;
  segments_ = Segments{false, address, {}, 0, sized ? announced : 0, false};
  return {};
}

std::optional<SdoAbort> DriveDictionary::download_segment(const CanFrame& frame, CanFrame* answer) {
  if (!segments_ || segments_->upload) return SdoAbort::kBadCommand;
  if (((frame.data[0] & 0x10) != 0) != segments_->toggle) return SdoAbort::kToggle;
  const std::size_t size = 7U - (frame.data[0] >> 1 & 7U);
  segments_->data.insert(segments_->data.end(), frame.data.begin() + 1,
                         frame.data.begin() + 1 + static_cast<std::ptrdiff_t>(size));
  if (segments_->data.size() > kLongestText) return SdoAbort::kTooLong;
  answer->data.fill(0);
  answer->data[0] = static_cast<std::uint8_t>(0x20 | (segments_->toggle ? 0x10 : 0));
  segments_->toggle = !segments_->toggle;
  if ((frame.data[0] & 1) == 0) return {};
  if (segments_->announced != 0 && segments_->data.size() != segments_->announced) return SdoAbort::kWrongLength;
  if (const auto refused = store(segments_->address, segments_->data)) return refused;
  segments_.reset();
  return {};
}

}  // namespace vantage::sim
