#include "estimation/request/submodel_text.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/process/error_message.hpp"

namespace stageid::test_submodel_text {

using testing::HasSubstr;

TEST(SubmodelText, SaysEverythingInOneLine) {
  const SubmodelRequest r = parse_submodel("n=4,m=3,f=120:180.5,zeta=0.01:2e-2");
  EXPECT_EQ(r.shape.order, 4);
  EXPECT_EQ(r.shape.numerator_degree, 3);
  EXPECT_EQ(r.shape.integrators, 0);
  EXPECT_EQ(r.frequency_hz, (std::vector<double>{120.0, 180.5}));
  EXPECT_EQ(r.damping_ratio, (std::vector<double>{0.01, 0.02}));
  EXPECT_EQ(parse_submodel("n=4").shape.numerator_degree, 3);
  EXPECT_EQ(parse_submodel("l=2").shape.numerator_degree, 1);
  EXPECT_EQ(parse_submodel("n=2,l=1").shape.numerator_degree, 2);
  EXPECT_EQ(parse_submodel("n=0").shape.numerator_degree, 0);
  EXPECT_TRUE(parse_submodel("n=auto").order_by_search);
  for (const char* text :
       {"l=0,n=4,m=3,f=120:180,zeta=0.01", "l=2,n=0,m=1", "n=auto", "l=1,n=3,m=3,f=10:20"})
    EXPECT_EQ(submodel_text(parse_submodel(text)), text);
}

TEST(SubmodelText, WhatIsWrongIsNamed) {
  const auto wrong = [](const char* text, const char* part) {
    EXPECT_THAT(test::error_message<std::invalid_argument>([text] { parse_submodel(text); }),
                testing::AllOf(HasSubstr("--submodel: '"), HasSubstr(part)))
        << text;
  };
  wrong("", "expected key=value");
  wrong("2,0,0", "expected key=value, got '2'");
  wrong("m=1", "the order n is missing");
  wrong("n=2.5", "not a whole number");
  wrong("n=", "or auto");
  wrong("n=2,n=4", "duplicate key 'n'");
  wrong("n=2,order=3", "unknown key 'order'");
  wrong("n=2,f=abc", "not a list of numbers separated by colons");
  wrong("n=2,f=", "not a list of numbers separated by colons");
  wrong("n=2,f=1e999", "not a list of numbers separated by colons");
  wrong("n=auto,m=2", "m is determined by n=auto");
  wrong("n=2,m=3", "improper");
  wrong("n=4,f=120", "2 frequencies");
}

}  // namespace stageid::test_submodel_text
