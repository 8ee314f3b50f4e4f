#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drivers/can/can_bus.h"
#include "drivers/can/object_table.h"
#include "drivers/can/sdo_abort.h"

namespace vantage::sim {

/// The objects of a simulated drive and the server of their transfers (CiA 301, SDO). Written apart from the master's
/// side, which it is a second opinion on.
class DriveDictionary {
 public:
  using Address = can::ObjectAddress;
  /// Asked before a value from the bus is kept: a reason to refuse it, or nothing.
  using Judge = std::function<std::optional<can::SdoAbort>(Address, std::int64_t)>;
  /// Told after a value from the bus was kept.
  using Listener = std::function<void(Address, std::int64_t)>;

  void define(Address address, const can::ObjectEntry& entry, std::int64_t value = 0);
  void define_text(Address address, const std::string& name, const std::string& text, bool writable);
  void on_write(Judge judge, Listener listener);

  bool has(Address address) const { return numbers_.count(address) != 0; }
  int size_of(Address address) const;
  std::int64_t get(Address address) const;
  void set(Address address, std::int64_t value);
  /// Keeps a value as if it came by SDO; the reason when it is refused.
  std::optional<can::SdoAbort> write(Address address, std::int64_t value);
  std::string text(Address address) const;
  /// For comparing with an EDS.
  can::ObjectMap entries() const;

  /// One frame of a master to this server; sends the answer.
  void serve(const can::CanFrame& frame, std::uint8_t node, can::CanBus& bus);

 private:
  struct Number {
    can::ObjectEntry entry;
    std::int64_t value = 0;
  };
  struct Text {
    can::ObjectEntry entry;
    std::string value;
  };
  /// A transfer in segments that is under way.
  struct Segments {
    bool upload = false;
    Address address;
    std::vector<std::uint8_t> data;
    std::size_t position = 0, announced = 0;
    bool toggle = false;
  };

  std::optional<can::SdoAbort> fetch(Address address, std::vector<std::uint8_t>* data) const;
  std::optional<can::SdoAbort> store(Address address, std::span<const std::uint8_t> data);
  bool knows_index(std::uint16_t index) const;
  std::optional<can::SdoAbort> begin_upload(Address address, can::CanFrame* answer);
  std::optional<can::SdoAbort> begin_download(const can::CanFrame& frame, Address address, can::CanFrame* answer);
  std::optional<can::SdoAbort> upload_segment(const can::CanFrame& frame, can::CanFrame* answer);
  std::optional<can::SdoAbort> download_segment(const can::CanFrame& frame, can::CanFrame* answer);

  std::map<Address, Number> numbers_;
  std::map<Address, Text> texts_;
  Judge judge_;
  Listener listener_;
  std::optional<Segments> segments_;
};

}  // namespace vantage::sim
