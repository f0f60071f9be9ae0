// IN OUT jet K DEGREE, or IN OUT pca K: unit normals of the points, three doubles each, as the
// positions in IN. K neighbours besides the point itself.
#include <CGAL/Simple_cartesian.h>
#include <CGAL/jet_estimate_normals.h>
#include <CGAL/pca_estimate_normals.h>
#include <CGAL/property_map.h>
#include <cstdlib>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

using Kernel = CGAL::Simple_cartesian<double>;
using Oriented = std::pair<Kernel::Point_3, Kernel::Vector_3>;

int main(int, char** arguments) {
    std::ifstream file(arguments[1], std::ios::binary | std::ios::ate);
    std::vector<double> values(file.tellg() / sizeof(double));
    file.seekg(0);
    file.read(reinterpret_cast<char*>(values.data()), values.size() * sizeof(double));
    std::vector<Oriented> points;
    for (size_t i = 0; i + 2 < values.size(); i += 3)
        points.emplace_back(Kernel::Point_3(values[i], values[i + 1], values[i + 2]),
                            Kernel::Vector_3());
    const auto k = static_cast<unsigned>(std::atoi(arguments[4]));
    const auto maps = CGAL::parameters::point_map(CGAL::First_of_pair_property_map<Oriented>())
        .normal_map(CGAL::Second_of_pair_property_map<Oriented>());
    if (std::string(arguments[3]) == "jet")
        CGAL::jet_estimate_normals<CGAL::Sequential_tag>(
            points, k, maps.degree_fitting(std::atoi(arguments[5])));
    else
        CGAL::pca_estimate_normals<CGAL::Sequential_tag>(points, k, maps);
    std::ofstream out(arguments[2], std::ios::binary);
    for (const auto& point : points) {
        const double normal[] = {point.second.x(), point.second.y(), point.second.z()};
        out.write(reinterpret_cast<const char*>(normal), sizeof normal);
    }
}
