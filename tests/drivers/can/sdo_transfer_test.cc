#include "drivers/can/sdo_transfer.h"

#include <random>
#include <string>

#include <gtest/gtest.h>

namespace vantage::can {
namespace {

using Step = SdoTransfer::Step;

std::string hex(const CanFrame& frame) {
  std::string text;
  char byte[4];
  for (const std::uint8_t value : frame.payload()) {
    std::snprintf(byte, sizeof byte, "%02X", value);
    text += byte;
  }
  return text;
}

CanFrame answer(std::initializer_list<std::uint8_t> payload) { return make_frame(0x585, payload); }

// Bytes by hand from CiA 301 (7.2.4.3) and the table in hardware-facts.

TEST(SdoTransfer, ReadsExpedited) {
  SdoTransfer transfer = SdoTransfer::reading(5, {0x6041, 0});
  EXPECT_EQ(transfer.request().id, 0x605U);
  EXPECT_EQ(hex(transfer.request()), "4041600000000000");
  EXPECT_EQ(transfer.answer(answer({0x4B, 0x41, 0x60, 0, 0x37, 0x02, 0, 0})), Step::kDone);
  EXPECT_EQ(transfer.data(), (std::vector<std::uint8_t>{0x37, 0x02}));
}

TEST(SdoTransfer, WritesOneTwoAndFourBytesExpedited) {
  const std::uint8_t data[] = {1, 2, 3, 4};
  EXPECT_EQ(hex(SdoTransfer::writing(5, {0x6060, 0}, std::span(data).first(1)).request()), "2F60600001000000");
  EXPECT_EQ(hex(SdoTransfer::writing(5, {0x6040, 0}, std::span(data).first(2)).request()), "2B40600001020000");
  SdoTransfer transfer = SdoTransfer::writing(5, {0x607A, 0}, data);
  EXPECT_EQ(hex(transfer.request()), "237A600001020304");
  EXPECT_EQ(transfer.answer(answer({0x60, 0x7A, 0x60, 0, 0, 0, 0, 0})), Step::kDone);
}

TEST(SdoTransfer, ReadsInSegmentsWithAlternatingToggle) {
  SdoTransfer transfer = SdoTransfer::reading(5, {0x1008, 0});
  EXPECT_EQ(transfer.answer(answer({0x41, 0x08, 0x10, 0, 10, 0, 0, 0})), Step::kSend);
  EXPECT_EQ(hex(transfer.request()), "6000000000000000");
  EXPECT_EQ(transfer.answer(answer({0x00, 'V', 'a', 'n', 't', 'a', 'g', 'e'})), Step::kSend);
  EXPECT_EQ(hex(transfer.request()), "7000000000000000");
  EXPECT_EQ(transfer.answer(answer({0x19, ' ', '1', '2', 0, 0, 0, 0})), Step::kDone);  // toggle, 4 unused, last
  EXPECT_EQ(std::string(transfer.data().begin(), transfer.data().end()), "Vantage 12");
}

TEST(SdoTransfer, WritesInSegments) {
  const std::string text = "axis label";
  SdoTransfer transfer =
      SdoTransfer::writing(5, {0x2000, 0}, std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
  EXPECT_EQ(hex(transfer.request()), "210020000A000000");
  EXPECT_EQ(transfer.answer(answer({0x60, 0x00, 0x20, 0, 0, 0, 0, 0})), Step::kSend);
  EXPECT_EQ(hex(transfer.request()), "0061786973206C61");
  EXPECT_EQ(transfer.answer(answer({0x20, 0, 0, 0, 0, 0, 0, 0})), Step::kSend);
  EXPECT_EQ(hex(transfer.request()), "1962656C00000000");
  EXPECT_EQ(transfer.answer(answer({0x30, 0, 0, 0, 0, 0, 0, 0})), Step::kDone);
}

TEST(SdoTransfer, AnAbortEndsItInWords) {
  SdoTransfer transfer = SdoTransfer::reading(5, {0x60C2, 1});
  EXPECT_EQ(transfer.answer(answer({0x80, 0xC2, 0x60, 1, 0x11, 0x00, 0x09, 0x06})), Step::kFailed);
  EXPECT_EQ(transfer.request().size, 0);  // nothing to say to that
  EXPECT_EQ(sdo_abort_text(transfer.abort_code()), "the object has no such subindex (abort 0x06090011)");
  EXPECT_EQ(sdo_abort_text(0x12345678), "a reason of the maker's own (abort 0x12345678)");
}

TEST(SdoTransfer, WhatBelongsToAnotherTransferIsPassedOver) {
  SdoTransfer transfer = SdoTransfer::reading(5, {0x6041, 0});
  EXPECT_EQ(transfer.answer(make_frame(0x586, {0x4B, 0x41, 0x60, 0, 1, 2, 0, 0})), Step::kIgnored);
  EXPECT_EQ(transfer.answer(answer({0x4B, 0x64, 0x60, 0, 1, 2, 0, 0})), Step::kIgnored);
  EXPECT_EQ(transfer.answer(answer({0x80, 0x64, 0x60, 0, 0, 0, 4, 5})), Step::kIgnored);
  EXPECT_EQ(transfer.answer(make_frame(0x585, {0x4B, 0x41})), Step::kIgnored);
  EXPECT_EQ(transfer.answer(answer({0x4B, 0x41, 0x60, 0, 1, 2, 0, 0})), Step::kDone);
  EXPECT_EQ(transfer.answer(answer({0x4B, 0x41, 0x60, 0, 1, 2, 0, 0})), Step::kIgnored);
}

TEST(SdoTransfer, AWrongToggleACommandOutOfTurnAndALieAboutTheLengthAreAborted) {
  SdoTransfer toggle = SdoTransfer::reading(5, {0x1008, 0});
  toggle.answer(answer({0x41, 0x08, 0x10, 0, 10, 0, 0, 0}));
  EXPECT_EQ(toggle.answer(answer({0x10, 1, 2, 3, 4, 5, 6, 7})), Step::kFailed);
  EXPECT_EQ(hex(toggle.request()), "8008100000000305");
  SdoTransfer command = SdoTransfer::reading(5, {0x1008, 0});
  EXPECT_EQ(command.answer(answer({0x60, 0x08, 0x10, 0, 0, 0, 0, 0})), Step::kFailed);
  SdoTransfer length = SdoTransfer::reading(5, {0x1008, 0});
  length.answer(answer({0x41, 0x08, 0x10, 0, 10, 0, 0, 0}));
  EXPECT_EQ(length.answer(answer({0x01, 1, 2, 3, 4, 5, 6, 7})), Step::kFailed);  // seven bytes, and no more
  EXPECT_EQ(length.abort_code(), static_cast<std::uint32_t>(SdoAbort::kWrongLength));
  SdoTransfer huge = SdoTransfer::reading(5, {0x1008, 0});
  EXPECT_EQ(huge.answer(answer({0x41, 0x08, 0x10, 0, 0, 0, 0, 0x7F})), Step::kFailed);
  EXPECT_EQ(huge.abort_code(), static_cast<std::uint32_t>(SdoAbort::kOutOfMemory));
}

TEST(SdoTransfer, ADriveThatNeverEndsIsCutOff) {
  SdoTransfer transfer = SdoTransfer::reading(5, {0x1008, 0});
  transfer.answer(answer({0x40, 0x08, 0x10, 0, 0, 0, 0, 0}));
  std::uint8_t toggle = 0;
  int segments = 0;
  while (transfer.answer(answer({toggle, 1, 2, 3, 4, 5, 6, 7})) == Step::kSend && segments < 100'000) {
    toggle ^= 0x10;
    ++segments;
  }
  EXPECT_LE(static_cast<std::size_t>(segments) * 7, SdoTransfer::kMostBytes);
}

}  // namespace
}  // namespace vantage::can
